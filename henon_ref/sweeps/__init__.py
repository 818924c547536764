"""Sweeps: many runs of one system at many points, with observations and results on disk."""
