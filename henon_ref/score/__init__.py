"""Scoring: transitions matched against the truth, errors, timing, and the pool of workers that does the runs."""
