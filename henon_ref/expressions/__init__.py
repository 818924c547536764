"""Expressions, as text or SymPy: read, checked, evaluated in exact numbers, with bounded work."""
