"""Points for a sweep: ``henon_ref.points``."""

from henon_ref.sweeps.draws import random
from henon_ref.sweeps.points import Points, continuation, grid, table

__all__ = ["Points", "continuation", "grid", "random", "table"]
