"""Which solver gets the stick-slip transitions of a Filippov system right, to how many digits, at what cost.

>>> import henon_ref
>>> case = henon_ref.load_case("cases/fig8.yaml")  # doctest: +SKIP
>>> comparison = henon_ref.compare(case, solvers=["henon", "heyoka"])  # doctest: +SKIP

Everything is loaded on first use, so that importing the package costs next to nothing.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from henon_ref.comparison import Comparison, compare
    from henon_ref.errors import CaseError, HenonRefError, ModelError, UnavailableError, UnsupportedError
    from henon_ref.model.case import Case, Reading, load_case, parse_case
    from henon_ref.model.system import FilippovSystem
    from henon_ref.solver import Solver
    from henon_ref.trajectory import Counts, Problem, Trajectory, Transition

__version__ = "0.1.0"

_HOME = {
    "Comparison": "comparison",
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
    "Comparison",
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
    if name == "compare":
        return import_module("henon_ref.compare")
    if name in _HOME:
        value = getattr(import_module(f"henon_ref.{_HOME[name]}"), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'henon_ref' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


class _CallableModule(ModuleType):
    """The module of the command, which can be called as the function of the same name."""

    def __call__(self, *arguments: Any, **options: Any) -> Comparison:
        from henon_ref.comparison import compare

        return compare(*arguments, **options)


class _Package(ModuleType):
    # `python -m henon_ref.compare` needs a module of that name, `henon_ref.compare(case)` a function. Importing
    # the module makes it an attribute of this package, so it is made callable there, whoever imports it first.
    def __setattr__(self, name: str, value: object) -> None:
        if name == "compare" and isinstance(value, ModuleType):
            value.__class__ = _CallableModule
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
