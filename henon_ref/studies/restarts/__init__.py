"""Restart habits as an experiment: every library restarted after its events in every way, on a handful of cases."""
