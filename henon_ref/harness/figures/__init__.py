"""Figures of a comparison: digits against cost, errors of transitions."""
