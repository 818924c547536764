"""CVODE called from C: a program that is compiled for each system, without Python in its way."""
