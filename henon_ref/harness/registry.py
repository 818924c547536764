"""Solvers by name: the built-in ones, imported when asked for, and third parties' by entry point.

A third party registers an instance of :class:`henon_ref.solver.Solver` (or a function without arguments that
makes one) under the entry-point group ``henon_ref.solvers``; the entry point's name is the solver's. One that
holds no solver is listed all the same: its rows say what is wrong with it.

A library is restarted after every event in one of four ways (:mod:`baselines.restart`), one of which is its default:
``heyoka@direction`` is heyoka with another restart than ``heyoka``'s own. Such names are solvers like any other, and
are not listed by :func:`names`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, PackageNotFoundError, entry_points, version
from typing import Any, TypeVar, cast

from henon_ref.errors import CaseError, UnavailableError
from henon_ref.solver import Solver, fault
from henon_ref.text import did_you_mean, listed
from henon_ref.workers.machine import LIBRARIES, library_versions

GROUP = "henon_ref.solvers"
T = TypeVar("T", bound=str | Solver)
COMPARED = (
    "scipy", "numba", "heyoka", "scikit-sundae", "matplotlib", "jinja2",
    "diffrax", "jax", "jaxlib", "optimistix", "nosnoc", "casadi", "pydiffsol",
)  # fmt: skip
"""Packages besides the reference's whose versions the results of a comparison depend on."""
RESTARTS = ("event-free-step", "offset", "direction", "none")
"""Ways of restarting a library on the surface it has just left; described in :mod:`baselines.restart`."""
ALL = "all"
"""In place of a solver's name: those that run by default, and the peers that are installed."""
AT = "@"
"""Between a solver's name and its restart."""
COMPILED = "+numba"
"""Mark of a library whose callbacks are compiled; without it, the same with plain Python."""


@dataclass(frozen=True)
class Entry:
    """Where a built-in solver is found, and what can be said of it without importing it."""

    target: str
    """``module:OBJECT``."""
    distribution: str
    """The installed package whose version the results name."""
    version: str = ""
    """``module:FUNCTION`` that tells the version of what is no package of Python; empty elsewhere."""
    fixed_step: bool = False
    by_default: bool = True
    """Run where neither the case nor the command names solvers."""
    restart: str = ""
    """Its default restart; empty for a solver that has no library to restart."""
    peer: bool = False
    """Its library comes with an extra of this project: it runs where it is named, or with ``all`` where it is there."""


SUNDIALS = "sundials"
"""The C library itself, as it is installed for a compiler."""
_SUNDIALS_VERSION = "baselines.cvode_c.build:library_version"

_BUILT_IN = {
    "henon": Entry("baselines.henon:HENON_SOLVER", "henon-ref"),
    "henon-newton": Entry("baselines.henon:HENON_NEWTON", "henon-ref", by_default=False),
    "henon-brent": Entry("baselines.henon:HENON_BRENT", "henon-ref", by_default=False),
    "henon-rk4": Entry("baselines.paper.rk4:RK4", "henon-ref", fixed_step=True),
    "henon-listing": Entry("baselines.paper.listing:LISTING", "henon-ref", fixed_step=True, by_default=False),
    "heyoka": Entry("baselines.heyoka_taylor:HEYOKA", "heyoka", restart="offset"),
    "cvode-adams": Entry("baselines.sundials_cvode:ADAMS", "scikit-sundae", restart="direction"),
    "cvode-bdf": Entry("baselines.sundials_cvode:BDF", "scikit-sundae", restart="direction"),
    "ida": Entry("baselines.sundials_ida:IDA", "scikit-sundae", restart="offset"),
    "scipy-rk45": Entry("baselines.scipy_ivp:RK45", "scipy", restart="offset"),
    "scipy-dop853": Entry("baselines.scipy_ivp:DOP853", "scipy", restart="offset"),
    "scipy-radau": Entry("baselines.scipy_ivp:RADAU", "scipy", restart="offset"),
    "scipy-bdf": Entry("baselines.scipy_ivp:BDF", "scipy", restart="offset"),
    "scipy-lsoda": Entry("baselines.scipy_ivp:LSODA", "scipy", restart="offset"),
    "cvode-c-adams": Entry("baselines.cvode_c.solver:ADAMS", SUNDIALS, _SUNDIALS_VERSION, by_default=False, peer=True),
    "cvode-c-bdf": Entry("baselines.cvode_c.solver:BDF", SUNDIALS, _SUNDIALS_VERSION, by_default=False, peer=True),
    "octave-ode45": Entry(
        "baselines.octave.solver:ODE45", "octave", "baselines.octave.solver:octave_version", by_default=False, peer=True
    ),
    "siconos": Entry(
        "baselines.siconos.solver:RELAY",
        "siconos",
        "baselines.siconos.solver:siconos_version",
        fixed_step=True,
        by_default=False,
        peer=True,
    ),
    "scipy-smoothed": Entry("baselines.scipy_naive:SMOOTHED", "scipy"),
    "scipy-sign": Entry("baselines.scipy_naive:SIGN", "scipy"),
    "diffrax-dopri8": Entry("baselines.diffrax_ode:DOPRI8", "diffrax", restart="offset", by_default=False, peer=True),
    "diffrax-kvaerno5": Entry(
        "baselines.diffrax_ode:KVAERNO5", "diffrax", restart="offset", by_default=False, peer=True
    ),
    "diffsol-tsit45": Entry("baselines.diffsol_ode:TSIT45", "pydiffsol", restart="offset", by_default=False, peer=True),
    "diffsol-bdf": Entry("baselines.diffsol_ode:BDF", "pydiffsol", restart="offset", by_default=False, peer=True),
    "nosnoc": Entry("baselines.nosnoc_fesd:NOSNOC", "nosnoc", by_default=False, peer=True),
    "heyoka+fastmath": Entry("baselines.heyoka_taylor:HEYOKA_FAST_MATH", "heyoka", by_default=False, restart="offset"),
    "cvode-adams+numba": Entry(
        "baselines.sundials_cvode:ADAMS_NUMBA", "scikit-sundae", by_default=False, restart="direction"
    ),
    "cvode-bdf+numba": Entry(
        "baselines.sundials_cvode:BDF_NUMBA", "scikit-sundae", by_default=False, restart="direction"
    ),
    "ida+numba": Entry("baselines.sundials_ida:IDA_NUMBA", "scikit-sundae", by_default=False, restart="offset"),
    "scipy-rk45+numba": Entry("baselines.scipy_ivp:RK45_NUMBA", "scipy", by_default=False, restart="offset"),
    "scipy-dop853+numba": Entry("baselines.scipy_ivp:DOP853_NUMBA", "scipy", by_default=False, restart="offset"),
    "scipy-radau+numba": Entry("baselines.scipy_ivp:RADAU_NUMBA", "scipy", by_default=False, restart="offset"),
    "scipy-bdf+numba": Entry("baselines.scipy_ivp:BDF_NUMBA", "scipy", by_default=False, restart="offset"),
    "scipy-lsoda+numba": Entry("baselines.scipy_ivp:LSODA_NUMBA", "scipy", by_default=False, restart="offset"),
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


def expanded(wanted: Sequence[T]) -> tuple[T | str, ...]:
    """The solvers, ``all`` replaced by those that run by default and the peers that are installed; each name once."""
    peers = tuple(name for name, entry in _BUILT_IN.items() if entry.peer and library_version(name))
    every = (*default_names(), *peers)
    found: dict[str, T | str] = {}
    for entry in wanted:
        for solver in every if isinstance(entry, str) and entry == ALL else (entry,):
            found.setdefault(solver if isinstance(solver, str) else solver.name, solver)
    return tuple(found.values())


def is_peer(name: str) -> bool:
    """Whether a built-in solver's library comes with an extra, so that it may not be installed."""
    base = base_name(name)
    return base in _BUILT_IN and _BUILT_IN[base].peer


def check(name: str) -> str:
    """The name itself, where there is such a solver.

    Raises
    ------
    CaseError
        With the nearest name, where there is none, or no such restart.
    """
    base, restart = _base_and_restart(name)
    if base not in names():
        raise CaseError(f"unknown solver '{base}'{did_you_mean(base, names())}; solvers: {listed(names())}")
    if base != name:
        check_restart(restart)
        if not restart_of(base):
            able = [known for known in default_names() if restart_of(known)]
            raise CaseError(f"'{base}' restarts no library, so it takes no '{AT}'; those that do: {listed(able)}")
    return name


def check_restart(restart: str) -> str:
    """The restart itself, where there is such a one.

    Raises
    ------
    CaseError
        With the nearest one, where there is none.
    """
    if restart not in RESTARTS:
        raise CaseError(f"unknown restart '{restart}'{did_you_mean(restart, RESTARTS)}; restarts: {listed(RESTARTS)}")
    return restart


def base_name(name: str) -> str:
    """The solver's name without its restart."""
    return _base_and_restart(name)[0]


def _base_and_restart(name: str) -> tuple[str, str]:
    """The solver's name and its restart; a third party's name may hold an ``@`` of its own."""
    if name in _third_party():
        return name, ""
    base, _, restart = name.partition(AT)
    return base, restart


def restart_of(name: str) -> str:
    """How a built-in solver restarts its library; empty where there is nothing to restart."""
    base, restart = _base_and_restart(name)
    return restart or (_BUILT_IN[base].restart if base in _BUILT_IN else "")


def with_restart(name: str, restart: str) -> str:
    """The name of a solver with this restart; one that has no library to restart stays as it is."""
    return f"{base_name(name)}{AT}{restart}" if restart_of(name) else name


def fixed_step(name: str) -> bool | None:
    """Whether a solver is driven by a step instead of tolerances; None for a third party's, which must be imported.

    (See :func:`henon_ref.harness.campaign.plugin_probe.fixed_step`, which has a worker import it.)
    """
    name = base_name(check(name))
    return _BUILT_IN[name].fixed_step if name in _BUILT_IN else None


_REFUSED: dict[EntryPoint, str] = {}
"""Entry points that hang or die when they are loaded, and what became of them; forked workers know them, too."""


def entry_point(name: str) -> EntryPoint:
    """Where a third party's solver is found."""
    return _third_party()[base_name(check(name))]


def refuse(point: EntryPoint, reason: str) -> None:
    """Never load an entry point in this process, for this reason."""
    _REFUSED[point] = f"the entry point {point.name} = {point.value} cannot be loaded: {reason}"


def distribution(name: str) -> str:
    """The package that a solver comes from; empty where that is not known."""
    name = base_name(name)
    if name in _BUILT_IN:
        return _BUILT_IN[name].distribution
    point = _third_party().get(name)
    return point.dist.name if point is not None and point.dist else ""


def library_version(name: str) -> str:
    """Version of the package a solver comes from, without importing it; empty where it is not installed."""
    package = distribution(name)
    if package in (programs := _programs()):
        return str(_imported(programs[package])())
    try:
        return version(package) if package else ""
    except PackageNotFoundError:
        return ""


def missing_package(name: str) -> str:
    """What pip installs where a built-in solver's library is missing; empty where it is there, or is no package."""
    entry = _BUILT_IN.get(base_name(name))
    if entry is None or entry.version or library_version(name):
        return ""
    return "henon-ref[peers]" if entry.peer else entry.distribution


def program_versions() -> dict[str, str]:
    """Versions of what solvers rest on that is no package of Python; empty where it is not installed."""
    return {package: str(_imported(target)()) for package, target in _programs().items()}


def all_versions() -> dict[str, str]:
    """Versions of all that a comparison depends on: the reference's packages, the libraries compared, programs."""
    return library_versions((*LIBRARIES, *COMPARED)) | program_versions()


def _programs() -> dict[str, str]:
    """Name of each of these -> the function that tells its version."""
    return {entry.distribution: entry.version for entry in _BUILT_IN.values() if entry.version}


def solver(name: str) -> Solver:
    """Import a solver.

    Raises
    ------
    CaseError
        Where there is no solver of that name, or no such restart.
    UnavailableError
        Where its library is not installed, or its entry point holds no solver.
    """
    check(name)
    base, restart = _base_and_restart(name)
    if base not in _BUILT_IN:
        return loaded(_third_party()[base])
    try:
        instance = cast(Solver, _imported(_BUILT_IN[base].target))
    except ImportError as error:
        raise UnavailableError(f"{name} cannot be imported: {error}") from error
    if not restart:
        return instance
    frozen: Any = instance  # a dataclass with a field for it: its entry here says so
    return cast(Solver, replace(frozen, name=name, restart=restart))


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


def _imported(target: str) -> Any:
    module, _, name = target.partition(":")
    return getattr(import_module(module), name)
