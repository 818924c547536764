"""Compare how accurately, and at what cost, solvers compute the stick-slip transitions of a Filippov system.

>>> import henon_ref
>>> case = henon_ref.load_case("cases/fig8.yaml")  # doctest: +SKIP
>>> comparison = henon_ref.compare(case, solvers=["henon", "heyoka"])  # doctest: +SKIP

All submodules are loaded on first use, so that importing the package is fast.
"""

from __future__ import annotations

import gc
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # also modules, under their public names
    import henon_ref.figures.sweeps as plots  # noqa: F401
    import henon_ref.sweeps.observe as observe  # noqa: F401
    import henon_ref.sweeps.points as points  # noqa: F401
    from henon_ref.analysis.lyapunov import lyapunov_exponents
    from henon_ref.analysis.periodic_orbit import periodic_orbit
    from henon_ref.analysis.tangent_points import tangent_points
    from henon_ref.baselines.adapter import ModeSolver
    from henon_ref.baselines.protocol.program import ProgramSolver
    from henon_ref.baselines.smooth_mode import SmoothMode
    from henon_ref.casefile.case import Case, Reading, load_case, parse_case
    from henon_ref.errors import (
        ArgumentError,
        CaseError,
        HenonRefError,
        ModelError,
        UnavailableError,
        UnsupportedError,
    )
    from henon_ref.harness.campaign.campaign import compare
    from henon_ref.harness.campaign.comparison import Comparison
    from henon_ref.harness.report.sweep import sweep
    from henon_ref.simulation.scene import Scene
    from henon_ref.simulation.simulate import load_run, simulate, stream
    from henon_ref.simulation.solution import Solution
    from henon_ref.simulation.system import System
    from henon_ref.solver import Solver
    from henon_ref.trajectory import Counts, Trajectory, Transition

__version__ = "0.2.0"

_NAMES = {
    "analysis.lyapunov": ("lyapunov_exponents",),
    "analysis.periodic_orbit": ("periodic_orbit",),
    "analysis.tangent_points": ("tangent_points",),
    "baselines.adapter": ("ModeSolver",),
    "baselines.protocol.program": ("ProgramSolver",),
    "baselines.smooth_mode": ("SmoothMode",),
    "casefile.case": ("Case", "Reading", "load_case", "parse_case"),
    "errors": ("ArgumentError", "CaseError", "HenonRefError", "ModelError", "UnavailableError", "UnsupportedError"),
    "harness.campaign.campaign": ("compare",),
    "harness.campaign.comparison": ("Comparison",),
    "harness.report.sweep": ("sweep",),
    "simulation.scene": ("Scene",),
    "simulation.simulate": ("load_run", "simulate", "stream"),
    "simulation.solution": ("Solution",),
    "simulation.system": ("System",),
    "solver": ("Solver",),
    "trajectory": ("Counts", "Trajectory", "Transition"),
}
_HOME = {name: module for module, names in _NAMES.items() for name in names}

_MODULES = {"observe": "sweeps.observe", "plots": "figures.sweeps", "points": "sweeps.points"}
"""Modules used with :func:`sweep`: observations, points, figures."""

__all__ = [
    "ArgumentError",
    "Case",
    "CaseError",
    "Comparison",
    "Counts",
    "HenonRefError",
    "ModeSolver",
    "ModelError",
    "ProgramSolver",
    "Reading",
    "Scene",
    "SmoothMode",
    "Solution",
    "Solver",
    "System",
    "Trajectory",
    "Transition",
    "UnavailableError",
    "UnsupportedError",
    "compare",
    "load_case",
    "load_run",
    "lyapunov_exponents",
    "parse_case",
    "periodic_orbit",
    "simulate",
    "stream",
    "sweep",
    "tangent_points",
]


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return _loaded(f"henon_ref.{_MODULES[name]}")
    if name in _HOME:
        value = getattr(_loaded(f"henon_ref.{_HOME[name]}"), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'henon_ref' has no attribute {name!r}")


def _loaded(module: str) -> ModuleType:
    """Import a module with the garbage collector off: an import creates no garbage, and the collector takes a tenth of
    the time to a first run."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        return import_module(module)
    finally:
        if enabled:
            gc.enable()


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, *_MODULES})
