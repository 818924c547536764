"""Scoring: transitions matched against the truth, errors, verdicts, sticks, the gate; pure functions."""
