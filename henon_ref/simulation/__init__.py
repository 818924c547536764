"""One run from Python: a system, its simulation, and what is asked of the solution."""
