"""Roots of a step's polynomial: isolated in double precision, and in multiprecision."""
