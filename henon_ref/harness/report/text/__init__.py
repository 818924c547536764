"""Reports in markdown."""
