"""Solvers in other languages, each a program that speaks :mod:`henon_ref.baselines.protocol`."""
