"""Solvers in other languages: a program reads a problem as JSON on its standard input and writes its transitions."""
