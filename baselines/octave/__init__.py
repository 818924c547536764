"""Octave's ``ode45`` with events, in a program in Octave's own language."""
