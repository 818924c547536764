"""Solvers by name: the built-in ones, imported when asked for, and third parties' by entry point.

A third party registers an instance of :class:`henon_ref.solver.Solver` (or a function without arguments that
makes one) under the entry-point group ``henon_ref.solvers``; the entry point's name is the solver's. One that
holds no solver is listed all the same: its rows say what is wrong with it.

A library is restarted after every event in one of four ways (:mod:`henon_ref.baselines.restart`), one of which is its
default: ``heyoka@direction`` is heyoka with another restart than ``heyoka``'s own. Such names are solvers like any
other, and are not listed by :func:`names`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, PackageNotFoundError, entry_points, version
from typing import Any, TypeVar, cast

from henon_ref.casefile.expected import unknown_solver
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
"""Ways of restarting a library on the surface it has just left; described in :mod:`henon_ref.baselines.restart`."""
ALL = "all"
"""In place of a solver's name: those that run by default, and the peers that are installed."""
AT = "@"
"""Between a solver's name and its restart."""
COMPILED = "+numba"
"""Mark of a library whose callbacks are compiled; without it, the same with plain Python."""


@dataclass(frozen=True)
class AdapterFile:
    """What can be said of solvers in one file of ``baselines`` without importing it."""

    module: str
    """Below ``baselines``."""
    distribution: str
    """The installed package, or the program, whose version the results name."""
    solvers: Mapping[str, str]
    """Name of each solver -> object of the module."""
    restart: str = ""
    """Their default restart; empty where there is no library to restart."""
    default: tuple[str, ...] | None = None
    """Those that run where neither the case nor the command names solvers; None: all of them."""
    fixed_step: bool = False
    peer: bool = False
    """Its library comes with an extra of this project, or is a program: it runs where it is named, or with ``all``."""
    program: bool = False
    """It is no package of Python: the solver itself tells its version."""
    callbacks: bool = False
    """Its callbacks can be compiled: each solver is there as ``NAME+numba``, too."""

    def by_default(self, name: str) -> bool:
        """Whether a solver runs where nobody names any."""
        return not self.peer and name in (self.solvers if self.default is None else self.default)

    def solver(self, name: str) -> Any:
        """The object of that name."""
        return getattr(import_module(f"henon_ref.baselines.{self.module}"), self.solvers[name])


HENON = {"henon": "HENON_SOLVER", "henon-newton": "HENON_NEWTON", "henon-brent": "HENON_BRENT"}
HEYOKA = {"heyoka": "HEYOKA", "heyoka+fastmath": "HEYOKA_FAST_MATH"}
SCIPY = {f"scipy-{method.lower()}": method for method in ("RK45", "DOP853", "RADAU", "BDF", "LSODA")}
CVODE = {"cvode-adams": "ADAMS", "cvode-bdf": "BDF"}
CVODE_C = {"cvode-c-adams": "ADAMS", "cvode-c-bdf": "BDF"}
DIFFRAX = {"diffrax-dopri8": "DOPRI8", "diffrax-kvaerno5": "KVAERNO5"}
DIFFSOL = {"diffsol-tsit45": "TSIT45", "diffsol-bdf": "BDF"}
FILES = (
    AdapterFile("henon", "henon-ref", HENON, default=("henon",)),
    AdapterFile("paper.rk4", "henon-ref", {"henon-rk4": "RK4"}, fixed_step=True),
    AdapterFile("paper.listing", "henon-ref", {"henon-listing": "LISTING"}, default=(), fixed_step=True),
    AdapterFile("heyoka_taylor", "heyoka", HEYOKA, "offset", default=("heyoka",)),
    AdapterFile("sundials", "scikit-sundae", CVODE, "direction", callbacks=True),
    AdapterFile("sundials", "scikit-sundae", {"ida": "IDA"}, "offset", callbacks=True),
    AdapterFile("scipy_ivp", "scipy", SCIPY, "offset", callbacks=True),
    AdapterFile("programs.cvode_c", "sundials", CVODE_C, peer=True, program=True),
    AdapterFile("programs.interpreted", "octave", {"octave-ode45": "ODE45"}, peer=True, program=True),
    AdapterFile("programs.interpreted", "siconos", {"siconos": "RELAY"}, peer=True, program=True, fixed_step=True),
    AdapterFile("scipy_naive", "scipy", {"scipy-smoothed": "SMOOTHED", "scipy-sign": "SIGN"}),
    AdapterFile("diffrax_ode", "diffrax", DIFFRAX, "offset", peer=True),
    AdapterFile("diffsol_ode", "pydiffsol", DIFFSOL, "offset", peer=True),
    AdapterFile("nosnoc_fesd", "nosnoc", {"nosnoc": "NOSNOC"}, peer=True),
)
"""One a library, and default restart."""
_PLAIN = {name: file for file in FILES for name in file.solvers}
_BUILT_IN = dict(sorted(_PLAIN.items(), key=lambda named: "+" in named[0])) | {
    name + COMPILED: file for name, file in _PLAIN.items() if file.callbacks
}
"""Name of a solver -> its file; variants come last."""


@cache
def _third_party() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=GROUP) if point.name not in _BUILT_IN}


def names() -> tuple[str, ...]:
    """Every solver's name, the built-in ones first."""
    return (*_BUILT_IN, *sorted(_third_party()))


def default_names() -> tuple[str, ...]:
    """The solvers that run where nobody names any."""
    return tuple(name for name in names() if name not in _BUILT_IN or _BUILT_IN[name].by_default(name))


def expanded(wanted: Sequence[T]) -> tuple[T | str, ...]:
    """The solvers, ``all`` replaced by those that run by default and the peers that are installed; each name once."""
    peers = tuple(name for name, file in _BUILT_IN.items() if file.peer and library_version(name))
    every = (*default_names(), *peers)
    found: dict[str, T | str] = {}
    for entry in wanted:
        for solver in every if isinstance(entry, str) and entry == ALL else (entry,):
            found.setdefault(solver if isinstance(solver, str) else solver.name, solver)
    return tuple(found.values())


def is_peer(name: str) -> bool:
    """Whether a built-in solver's library comes with an extra, so that it may not be installed."""
    file = _file(name)
    return file is not None and file.peer


def check(name: str) -> str:
    """The name itself, where there is such a solver.

    Raises
    ------
    CaseError
        With the nearest name, where there is none, or no such restart.
    """
    base, restart = _base_and_restart(name)
    if base not in names():
        raise CaseError(unknown_solver(base, names()))
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


def _file(name: str) -> AdapterFile | None:
    """That of a built-in solver, whatever its restart; None for a third party's."""
    return _BUILT_IN.get(base_name(name))


def _base_and_restart(name: str) -> tuple[str, str]:
    """The solver's name and its restart; a third party's name may hold an ``@`` of its own."""
    if name in _third_party():
        return name, ""
    base, _, restart = name.partition(AT)
    return base, restart


def restart_of(name: str) -> str:
    """How a built-in solver restarts its library; empty where there is nothing to restart."""
    file, restart = _file(name), _base_and_restart(name)[1]
    return restart or (file.restart if file is not None else "")


def with_restart(name: str, restart: str) -> str:
    """The name of a solver with this restart; one that has no library to restart stays as it is."""
    return f"{base_name(name)}{AT}{restart}" if restart_of(name) else name


def fixed_step(name: str) -> bool | None:
    """Whether a solver is driven by a step instead of tolerances; None for a third party's, which must be imported.

    (See :func:`henon_ref.harness.campaign.case_files.fixed_step`, which has a worker import it.)
    """
    file = _file(check(name))
    return None if file is None else file.fixed_step


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
    file, point = _file(name), _third_party().get(base_name(name))
    if file is not None:
        return file.distribution
    return point.dist.name if point is not None and point.dist else ""


def library_version(name: str) -> str:
    """Version of the package a solver comes from, without importing it; empty where it is not installed."""
    file, package = _file(name), distribution(name)
    if file is not None and file.program:
        return str(file.solver(base_name(name)).version)
    try:
        return version(package) if package else ""
    except PackageNotFoundError:
        return ""


def missing_package(name: str) -> str:
    """What pip installs where a built-in solver's library is missing; empty where it is there, or is no package."""
    file = _file(name)
    if file is None or file.program or library_version(name):
        return ""
    return "henon-ref[peers]" if file.peer else file.distribution


def program_versions() -> dict[str, str]:
    """Versions of what solvers rest on that is no package of Python; empty where it is not installed."""
    return {file.distribution: library_version(next(iter(file.solvers))) for file in FILES if file.program}


def all_versions() -> dict[str, str]:
    """Versions of all that a comparison depends on: the reference's packages, the libraries compared, programs."""
    return library_versions((*LIBRARIES, *COMPARED)) | program_versions()


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
    file, plain = _BUILT_IN[base], base.removesuffix(COMPILED)
    try:
        instance = file.solver(plain)
    except ImportError as error:
        raise UnavailableError(f"{name} cannot be imported: {error}") from error
    options = ({"restart": restart} if restart else {}) | ({"callbacks": "numba"} if base != plain else {})
    return cast(Solver, replace(instance, name=name, **options) if options else instance)


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
