"""Siconos: relay and time stepping, run by the Python that it is installed for."""
