"""Solvers by name: the built-in ones, imported when asked for, and third parties' by entry point.

A third party registers an instance of :class:`henon_ref.solver.Solver` (or a function without arguments that
makes one) under the entry-point group ``henon_ref.solvers``; the entry point's name is the solver's.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, PackageNotFoundError, entry_points, version
from typing import cast

from henon_ref.errors import CaseError, UnavailableError
from henon_ref.model.grammar import did_you_mean, listed
from henon_ref.solver import Solver

GROUP = "henon_ref.solvers"


@dataclass(frozen=True)
class Entry:
    """Where a built-in solver is found, and what can be said of it without importing it."""

    module: str
    distribution: str
    """The installed package whose version the results name."""
    fixed_step: bool = False
    by_default: bool = True
    """Run where neither the case nor the command names solvers."""


_BUILT_IN = {
    "henon": Entry("henon_ref.henon.solvers", "henon-ref"),
    "henon-newton": Entry("henon_ref.henon.solvers", "henon-ref", by_default=False),
    "henon-brent": Entry("henon_ref.henon.solvers", "henon-ref", by_default=False),
    "henon-rk4": Entry("henon_ref.henon.rk4", "henon-ref", fixed_step=True),
    "henon-listing": Entry("henon_ref.henon.listing", "henon-ref", fixed_step=True, by_default=False),
    "heyoka": Entry("baselines.heyoka_taylor", "heyoka"),
    "cvode-adams": Entry("baselines.sundials_cvode", "scikit-sundae"),
    "cvode-bdf": Entry("baselines.sundials_cvode", "scikit-sundae"),
    "ida": Entry("baselines.sundials_ida", "scikit-sundae"),
    "scipy-rk45": Entry("baselines.scipy_ivp", "scipy"),
    "scipy-dop853": Entry("baselines.scipy_ivp", "scipy"),
    "scipy-radau": Entry("baselines.scipy_ivp", "scipy"),
    "scipy-bdf": Entry("baselines.scipy_ivp", "scipy"),
    "scipy-lsoda": Entry("baselines.scipy_ivp", "scipy"),
    "scipy-smoothed": Entry("baselines.scipy_naive", "scipy"),
    "scipy-sign": Entry("baselines.scipy_naive", "scipy"),
    "heyoka+fastmath": Entry("baselines.heyoka_taylor", "heyoka", by_default=False),
    "cvode-adams+numba": Entry("baselines.sundials_cvode", "scikit-sundae", by_default=False),
    "cvode-bdf+numba": Entry("baselines.sundials_cvode", "scikit-sundae", by_default=False),
    "ida+numba": Entry("baselines.sundials_ida", "scikit-sundae", by_default=False),
    "scipy-rk45+numba": Entry("baselines.scipy_ivp", "scipy", by_default=False),
    "scipy-dop853+numba": Entry("baselines.scipy_ivp", "scipy", by_default=False),
    "scipy-radau+numba": Entry("baselines.scipy_ivp", "scipy", by_default=False),
    "scipy-bdf+numba": Entry("baselines.scipy_ivp", "scipy", by_default=False),
    "scipy-lsoda+numba": Entry("baselines.scipy_ivp", "scipy", by_default=False),
}


@cache
def _third_party() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=GROUP) if point.name not in _BUILT_IN}


def names() -> tuple[str, ...]:
    """Every solver's name, the built-in ones first."""
    return (*_BUILT_IN, *sorted(_third_party()))


def default_names() -> tuple[str, ...]:
    """The solvers that run where nobody names any."""
    return tuple(name for name in names() if name not in _BUILT_IN or _BUILT_IN[name].by_default)


def check(name: str) -> str:
    """The name itself, where there is such a solver.

    Raises
    ------
    CaseError
        With the nearest name, where there is none.
    """
    if name not in names():
        raise CaseError(f"unknown solver '{name}'{did_you_mean(name, names())}; solvers: {listed(names())}")
    return name


def fixed_step(name: str) -> bool:
    """Whether a solver is driven by a step instead of tolerances."""
    return _BUILT_IN[name].fixed_step if name in _BUILT_IN else solver(name).fixed_step


def distribution(name: str) -> str:
    """The package that a solver comes from; empty where that is not known."""
    if name in _BUILT_IN:
        return _BUILT_IN[name].distribution
    point = _third_party().get(name)
    return point.dist.name if point is not None and point.dist else ""


def library_version(name: str) -> str:
    """Version of the package a solver comes from, without importing it; empty where it is not installed."""
    package = distribution(name)
    try:
        return version(package) if package else ""
    except PackageNotFoundError:
        return ""


def solver(name: str) -> Solver:
    """Import a solver.

    Raises
    ------
    CaseError
        Where there is no solver of that name.
    UnavailableError
        Where its library is not installed.
    """
    check(name)
    try:
        if name in _BUILT_IN:
            return _instance(import_module(_BUILT_IN[name].module), name)
        found = _third_party()[name].load()
    except ImportError as error:
        raise UnavailableError(f"{name} cannot be imported: {error}") from error
    return found if isinstance(found, Solver) else found()


def _instance(module: object, name: str) -> Solver:
    for value in vars(module).values():
        if not isinstance(value, type) and getattr(value, "name", None) == name and hasattr(value, "prepare"):
            return cast(Solver, value)
    raise UnavailableError(f"{getattr(module, '__name__', module)} holds no solver named {name}")
