"""Programs in other languages that implement :mod:`henon_ref.baselines.protocol`."""
