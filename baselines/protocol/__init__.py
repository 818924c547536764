"""Solvers in other languages: a program gets a problem as JSON on its standard input and writes what it found."""
