"""Adapters of existing ODE solvers, one file per library. One driver handles the modes for all of them."""
