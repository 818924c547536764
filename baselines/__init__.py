"""Solvers that people use today, one file a library, behind one driver that owns the modes."""
