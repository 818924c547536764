"""Scoring: transitions matched against the truth, errors, timing, and the fence each run stands behind."""
