"""Which solver gets the stick-slip transitions of a Filippov system right, to how many digits, at what cost.

>>> import henon_ref
>>> case = henon_ref.load_case("cases/fig8.yaml")  # doctest: +SKIP
>>> comparison = henon_ref.compare(case, solvers=["henon", "heyoka"])  # doctest: +SKIP

Everything is loaded on first use, so that importing the package costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from henon_ref.errors import CaseError, HenonRefError, ModelError, UnavailableError, UnsupportedError
    from henon_ref.model.case import Case, Reading, load_case, parse_case
    from henon_ref.model.system import FilippovSystem
    from henon_ref.solver import Solver
    from henon_ref.trajectory import Counts, Problem, Trajectory, Transition

__version__ = "0.1.0"

_HOME = {
    "CaseError": "errors",
    "HenonRefError": "errors",
    "ModelError": "errors",
    "UnavailableError": "errors",
    "UnsupportedError": "errors",
    "Case": "model.case",
    "Reading": "model.case",
    "load_case": "model.case",
    "parse_case": "model.case",
    "FilippovSystem": "model.system",
    "Solver": "solver",
    "Counts": "trajectory",
    "Problem": "trajectory",
    "Trajectory": "trajectory",
    "Transition": "trajectory",
}

__all__ = [
    "Case",
    "CaseError",
    "Counts",
    "FilippovSystem",
    "HenonRefError",
    "ModelError",
    "Problem",
    "Reading",
    "Solver",
    "Trajectory",
    "Transition",
    "UnavailableError",
    "UnsupportedError",
    "compare",
    "load_case",
    "parse_case",
]


def __getattr__(name: str) -> Any:
    # `henon_ref.compare` is both the command's module and the function of the contract: the module is callable.
    if name == "compare":
        return import_module("henon_ref.compare")
    if name in _HOME:
        value = getattr(import_module(f"henon_ref.{_HOME[name]}"), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'henon_ref' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
