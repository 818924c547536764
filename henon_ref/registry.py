"""Solvers by name: the built-in ones, imported when asked for, and third parties' by entry point.

A third party registers an instance of :class:`henon_ref.solver.Solver` (or a function without arguments that
makes one) under the entry-point group ``henon_ref.solvers``; the entry point's name is the solver's. One that
holds no solver is listed all the same: its rows say what is wrong with it.

A library is restarted after every event, and how is a habit of its own (:mod:`baselines.restart`):
``heyoka@direction`` is heyoka restarted by another habit than ``heyoka``'s own. Such names are solvers like any
other, and are not listed by :func:`names`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, PackageNotFoundError, entry_points, version
from typing import Any, cast

from henon_ref.errors import CaseError, UnavailableError
from henon_ref.solver import Solver, fault
from henon_ref.text import did_you_mean, listed

GROUP = "henon_ref.solvers"
RESTARTS = ("event-free-step", "offset", "direction", "none")
"""Habits of restarting a library on the surface it has just left; told in :mod:`baselines.restart`."""
AT = "@"
"""Between a solver's name and the habit it is restarted by."""
COMPILED = "+numba"
"""Mark of a library whose callbacks are compiled; without it, the same with plain Python."""


@dataclass(frozen=True)
class Entry:
    """Where a built-in solver is found, and what can be said of it without importing it."""

    module: str
    distribution: str
    """The installed package whose version the results name."""
    fixed_step: bool = False
    by_default: bool = True
    """Run where neither the case nor the command names solvers."""
    restart: str = ""
    """The habit it is restarted by; empty for a solver that has no library to restart."""


_BUILT_IN = {
    "henon": Entry("henon_ref.henon.solver", "henon-ref"),
    "henon-newton": Entry("henon_ref.henon.solver", "henon-ref", by_default=False),
    "henon-brent": Entry("henon_ref.henon.solver", "henon-ref", by_default=False),
    "henon-rk4": Entry("henon_ref.henon.rk4", "henon-ref", fixed_step=True),
    "henon-listing": Entry("henon_ref.henon.listing", "henon-ref", fixed_step=True, by_default=False),
    "heyoka": Entry("baselines.heyoka_taylor", "heyoka", restart="offset"),
    "cvode-adams": Entry("baselines.sundials_cvode", "scikit-sundae", restart="event-free-step"),
    "cvode-bdf": Entry("baselines.sundials_cvode", "scikit-sundae", restart="event-free-step"),
    "ida": Entry("baselines.sundials_ida", "scikit-sundae", restart="event-free-step"),
    "scipy-rk45": Entry("baselines.scipy_ivp", "scipy", restart="event-free-step"),
    "scipy-dop853": Entry("baselines.scipy_ivp", "scipy", restart="event-free-step"),
    "scipy-radau": Entry("baselines.scipy_ivp", "scipy", restart="event-free-step"),
    "scipy-bdf": Entry("baselines.scipy_ivp", "scipy", restart="event-free-step"),
    "scipy-lsoda": Entry("baselines.scipy_ivp", "scipy", restart="event-free-step"),
    "scipy-smoothed": Entry("baselines.scipy_naive", "scipy"),
    "scipy-sign": Entry("baselines.scipy_naive", "scipy"),
    "heyoka+fastmath": Entry("baselines.heyoka_taylor", "heyoka", by_default=False, restart="offset"),
    "cvode-adams+numba": Entry(
        "baselines.sundials_cvode", "scikit-sundae", by_default=False, restart="event-free-step"
    ),
    "cvode-bdf+numba": Entry("baselines.sundials_cvode", "scikit-sundae", by_default=False, restart="event-free-step"),
    "ida+numba": Entry("baselines.sundials_ida", "scikit-sundae", by_default=False, restart="event-free-step"),
    "scipy-rk45+numba": Entry("baselines.scipy_ivp", "scipy", by_default=False, restart="event-free-step"),
    "scipy-dop853+numba": Entry("baselines.scipy_ivp", "scipy", by_default=False, restart="event-free-step"),
    "scipy-radau+numba": Entry("baselines.scipy_ivp", "scipy", by_default=False, restart="event-free-step"),
    "scipy-bdf+numba": Entry("baselines.scipy_ivp", "scipy", by_default=False, restart="event-free-step"),
    "scipy-lsoda+numba": Entry("baselines.scipy_ivp", "scipy", by_default=False, restart="event-free-step"),
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
        With the nearest name, where there is none, or no such habit of restarting it.
    """
    plain, habit = _parted(name)
    if plain not in names():
        raise CaseError(f"unknown solver '{plain}'{did_you_mean(plain, names())}; solvers: {listed(names())}")
    if plain != name:
        check_restart(habit)
        if not restart_of(plain):
            able = [known for known in default_names() if restart_of(known)]
            raise CaseError(f"'{plain}' restarts no library, so it takes no '{AT}'; those that do: {listed(able)}")
    return name


def check_restart(habit: str) -> str:
    """The habit itself, where there is such a one.

    Raises
    ------
    CaseError
        With the nearest habit, where there is none.
    """
    if habit not in RESTARTS:
        raise CaseError(f"unknown restart '{habit}'{did_you_mean(habit, RESTARTS)}; restarts: {listed(RESTARTS)}")
    return habit


def plain_name(name: str) -> str:
    """The solver's name without the habit it is restarted by."""
    return _parted(name)[0]


def _parted(name: str) -> tuple[str, str]:
    """The solver's name and the habit it is restarted by; a third party's name may hold an ``@`` of its own."""
    if name in _third_party():
        return name, ""
    plain, _, habit = name.partition(AT)
    return plain, habit


def restart_of(name: str) -> str:
    """The habit by which a built-in solver restarts its library; empty where there is nothing to restart."""
    plain, habit = _parted(name)
    return habit or (_BUILT_IN[plain].restart if plain in _BUILT_IN else "")


def with_restart(name: str, habit: str) -> str:
    """The name of a solver restarted by a habit; one that has no library to restart stays as it is."""
    return f"{plain_name(name)}{AT}{habit}" if restart_of(name) else name


def fixed_step(name: str) -> bool | None:
    """Whether a solver is driven by a step instead of tolerances; None for a third party's, which must be imported.

    (See :func:`henon_ref.campaign.plugin_probe.fixed_step`, which has a worker import it.)
    """
    name = plain_name(check(name))
    return _BUILT_IN[name].fixed_step if name in _BUILT_IN else None


_REFUSED: dict[EntryPoint, str] = {}
"""Entry points that hang or die when they are loaded, and what became of them; forked workers know them, too."""


def entry_point(name: str) -> EntryPoint:
    """Where a third party's solver is found."""
    return _third_party()[plain_name(check(name))]


def refuse(point: EntryPoint, reason: str) -> None:
    """Never load an entry point in this process, for this reason."""
    _REFUSED[point] = f"the entry point {point.name} = {point.value} cannot be loaded: {reason}"


def distribution(name: str) -> str:
    """The package that a solver comes from; empty where that is not known."""
    name = plain_name(name)
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
        Where there is no solver of that name, or no such habit of restarting it.
    UnavailableError
        Where its library is not installed, or its entry point holds no solver.
    """
    check(name)
    plain, habit = _parted(name)
    if plain not in _BUILT_IN:
        return loaded(_third_party()[plain])
    try:
        instance = _instance(import_module(_BUILT_IN[plain].module), plain)
    except ImportError as error:
        raise UnavailableError(f"{name} cannot be imported: {error}") from error
    if not habit:
        return instance
    frozen: Any = instance  # a dataclass with a field for it: its entry here says so
    return cast(Solver, replace(frozen, name=name, restart=habit))


def loaded(point: EntryPoint) -> Solver:
    """The solver that an entry point holds, or that the function it holds makes.

    Raises
    ------
    UnavailableError
        Where it holds none, or cannot be loaded.
    """
    if point in _REFUSED:
        raise UnavailableError(_REFUSED[point])
    where = f"the entry point {point.name} = {point.value}"
    try:
        found = point.load()
        if callable(found) and not isinstance(found, type | Solver):
            found = found()
        words = fault(found)
    except UnavailableError:
        raise
    except (Exception, SystemExit) as error:  # a stranger's module may raise anything when it is imported
        text = " ".join(str(error).split())
        raise UnavailableError(f"{where} cannot be loaded: {type(error).__name__}: {text}") from error
    if words:
        raise UnavailableError(f"{where} {words}")
    return cast(Solver, found)


def _instance(module: object, name: str) -> Solver:
    for value in vars(module).values():
        if not isinstance(value, type) and getattr(value, "name", None) == name and hasattr(value, "prepare"):
            return cast(Solver, value)
    raise UnavailableError(f"{getattr(module, '__name__', module)} holds no solver named {name}")
