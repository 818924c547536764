"""Compiling: numba's and our own modules, the cache of machine code, the target processor."""
