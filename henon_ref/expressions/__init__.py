"""Expressions, as text or SymPy: read, checked, evaluated in exact numbers, with bounded work.

A fault raises :class:`~henon_ref.errors.ExpressionError` with its offset in the text.
"""
