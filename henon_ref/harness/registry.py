"""Registry of solvers by name: built-in solvers, imported on demand, and third-party solvers from entry points.

A third party registers an instance of :class:`henon_ref.solver.Solver`, or a function without arguments that
returns one, under the entry-point group ``henon_ref.solvers``. The name of the entry point is the name of the solver.
An entry point that holds no solver is listed, too; its rows report the error.

A library is restarted after every event in one of four ways (:mod:`henon_ref.baselines.restart`). Each library has a
default restart; ``heyoka@direction`` is heyoka with the restart ``direction`` instead. A name with a restart can be
used like any other solver name, but :func:`names` does not list it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
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
RESTARTS = ("event-free-step", "offset", "direction", "none")
"""Ways to restart a library on the surface it has just left; described in :mod:`henon_ref.baselines.restart`."""
ALL = "all"
"""Name that stands for the solvers that run by default and the installed peers."""
AT = "@"
"""Separator between the name of a solver and its restart."""
COMPILED = "+numba"
"""Suffix of a solver whose callbacks are compiled by numba; without it the callbacks are plain Python."""


@dataclass(frozen=True)
class AdapterFile:
    """Description of the solvers in one module of ``baselines``, available without importing the module."""

    module: str
    """Name of the module within ``baselines``."""
    distribution: str
    """Installed package or program whose version the results record."""
    solvers: Mapping[str, str]
    """Name of each solver -> name of its object in the module."""
    restart: str = ""
    """Default restart of the solvers; empty if they restart no library."""
    default: tuple[str, ...] | None = None
    """Solvers that run if neither the case nor the command names solvers; None: all of them."""
    fixed_step: bool = False
    peer: bool = False
    """Whether the library is an optional extra or a program; its solvers run only if named, or by ``all``."""
    program: bool = False
    """Whether the library is not a Python package; the solver then reports its version itself."""
    callbacks: bool = False
    """Whether callbacks can be compiled; each solver then also exists as ``NAME+numba``."""

    def by_default(self, name: str) -> bool:
        """Check whether a solver runs if no solvers are named."""
        return not self.peer and name in (self.solvers if self.default is None else self.default)

    def solver(self, name: str) -> Any:
        """Import the module and return the object of a solver."""
        return getattr(import_module(f"henon_ref.baselines.{self.module}"), self.solvers[name])


def _methods(prefix: str, *methods: str) -> dict[str, str]:
    """Return the solvers of a library with several methods: name -> object in the module, named by the method."""
    return {f"{prefix}-{method.lower()}": method for method in methods}


HENON = {"henon": "HENON_SOLVER", "henon-newton": "HENON_NEWTON", "henon-brent": "HENON_BRENT"}
HEYOKA = {"heyoka": "HEYOKA", "heyoka+fastmath": "HEYOKA_FAST_MATH"}
FILES = (
    AdapterFile("henon", "henon-ref", HENON, default=("henon",)),
    AdapterFile("paper.rk4", "henon-ref", {"henon-rk4": "RK4"}, fixed_step=True),
    AdapterFile("paper.listing", "henon-ref", {"henon-listing": "LISTING"}, default=(), fixed_step=True),
    AdapterFile("heyoka_taylor", "heyoka", HEYOKA, "offset", default=("heyoka",)),
    AdapterFile("sundials", "scikit-sundae", _methods("cvode", "ADAMS", "BDF"), "direction", callbacks=True),
    AdapterFile("sundials", "scikit-sundae", {"ida": "IDA"}, "offset", callbacks=True),
    AdapterFile(
        "scipy_ivp", "scipy", _methods("scipy", "RK45", "DOP853", "RADAU", "BDF", "LSODA"), "offset", callbacks=True
    ),
    AdapterFile("cvode_c", "sundials", _methods("cvode-c", "ADAMS", "BDF"), peer=True, program=True),
    AdapterFile("interpreted", "octave", {"octave-ode45": "ODE45"}, peer=True, program=True),
    AdapterFile("interpreted", "siconos", {"siconos": "RELAY"}, peer=True, program=True, fixed_step=True),
    AdapterFile("scipy_naive", "scipy", {"scipy-smoothed": "SMOOTHED", "scipy-sign": "SIGN"}),
    AdapterFile("diffrax_ode", "diffrax", _methods("diffrax", "DOPRI8", "KVAERNO5"), "offset", peer=True),
    AdapterFile("diffsol_ode", "pydiffsol", _methods("diffsol", "TSIT45", "BDF"), "offset", peer=True),
    AdapterFile("nosnoc_fesd", "nosnoc", {"nosnoc": "NOSNOC"}, peer=True),
)
"""One entry for each pair of module and default restart."""
_BUILT_IN = dict(sorted(((name, file) for file in FILES for name in file.solvers), key=lambda named: "+" in named[0]))
_BUILT_IN |= {name + COMPILED: file for file in FILES if file.callbacks for name in file.solvers}
"""Name of a built-in solver -> its module; the variants come last."""


@cache
def _third_party() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=GROUP) if point.name not in _BUILT_IN}


def names() -> tuple[str, ...]:
    """Return the names of all solvers, the built-in ones first."""
    return (*_BUILT_IN, *sorted(_third_party()))


def in_order(solvers: Iterable[str]) -> list[str]:
    """Return distinct names in the order of :func:`names`; unknown names come last."""
    known, present = names(), set(solvers)
    return [name for name in known if name in present] + sorted(present.difference(known))


def default_names() -> tuple[str, ...]:
    """Return the names of the solvers that run if no solvers are named."""
    return tuple(name for name in names() if name not in _BUILT_IN or _BUILT_IN[name].by_default(name))


def expanded(wanted: Sequence[T]) -> tuple[T | str, ...]:
    """Replace ``all`` by the default solvers and the installed peers, and drop repeated names."""
    peers = tuple(name for name, file in _BUILT_IN.items() if file.peer and library_version(name))
    every = (*default_names(), *peers)
    found: dict[str, T | str] = {}
    for entry in wanted:
        for solver in every if isinstance(entry, str) and entry == ALL else (entry,):
            found.setdefault(solver if isinstance(solver, str) else solver.name, solver)
    return tuple(found.values())


def is_peer(name: str) -> bool:
    """Check whether the library of a built-in solver is an optional extra, and may therefore not be installed."""
    file = _file(name)
    return file is not None and file.peer


def check(name: str) -> str:
    """Return the name of a solver unchanged; CaseError with the nearest name if it or its restart does not exist."""
    base, restart = _base_and_restart(name)
    if base not in names():
        raise CaseError(unknown_solver(base, names()))
    if base != name:
        if restart not in RESTARTS:
            hint = did_you_mean(restart, RESTARTS)
            raise CaseError(f"unknown restart '{restart}'{hint}; restarts: {listed(RESTARTS)}")
        if not restart_of(base):
            able = [known for known in default_names() if restart_of(known)]
            raise CaseError(f"'{base}' restarts no library, so it takes no '{AT}'; solvers that do: {listed(able)}")
    return name


def base_name(name: str) -> str:
    """Return the name of a solver without its restart."""
    return _base_and_restart(name)[0]


def _file(name: str) -> AdapterFile | None:
    """Return the entry of a built-in solver with any restart; None for a third-party solver."""
    return _BUILT_IN.get(base_name(name))


def _base_and_restart(name: str) -> tuple[str, str]:
    """Split a name into solver and restart; the name of a third-party solver may itself contain ``@``."""
    if name in _third_party():
        return name, ""
    base, _, restart = name.partition(AT)
    return base, restart


def restart_of(name: str) -> str:
    """Return the restart of a built-in solver; empty if it restarts no library."""
    file, restart = _file(name), _base_and_restart(name)[1]
    return restart or (file.restart if file is not None else "")


def with_restart(name: str, restart: str) -> str:
    """Return the name of a solver with this restart; the name is unchanged if the solver restarts no library."""
    return f"{base_name(name)}{AT}{restart}" if restart_of(name) else name


def fixed_step(name: str) -> bool | None:
    """Check whether a solver takes a fixed step instead of tolerances; None for a third-party solver.

    A third-party solver must be imported to find out;
    :func:`henon_ref.harness.campaign.options.fixed_step` does so in a worker process.
    """
    file = _file(check(name))
    return None if file is None else file.fixed_step


_REFUSED: dict[EntryPoint, str] = {}
"""Entry points that hang or crash when they are loaded -> error message; forked workers inherit this table."""


def entry_point(name: str) -> EntryPoint:
    return _third_party()[base_name(check(name))]


def refuse(point: EntryPoint, reason: str) -> None:
    """Forbid this process to load an entry point, for the given reason."""
    _REFUSED[point] = f"the entry point {point.name} = {point.value} cannot be loaded: {reason}"


def distribution(name: str) -> str:
    """Return the name of the package that provides a solver; empty if unknown."""
    file, point = _file(name), _third_party().get(base_name(name))
    if file is not None:
        return file.distribution
    return point.dist.name if point is not None and point.dist else ""


def third_party_package(name: str) -> str:
    """Return the name of the top-level module or package that holds a third-party solver; empty for any other."""
    point = _third_party().get(base_name(name))
    return point.module.partition(".")[0] if point is not None else ""


def library_version(name: str) -> str:
    """Return the version of the package that provides a solver, without importing it; empty if not installed."""
    file, package = _file(name), distribution(name)
    if file is not None and file.program:
        return str(file.solver(base_name(name)).version)
    try:
        return version(package) if package else ""
    except PackageNotFoundError:
        return ""


def missing_package(name: str) -> str:
    """Return the pip requirement of a missing library; empty if it is installed, or is not a Python package."""
    file = _file(name)
    if file is None or file.program or library_version(name):
        return ""
    return "henon-ref[peers]" if file.peer else file.distribution


def program_versions() -> dict[str, str]:
    """Return the versions of the programs that solvers use; empty if not installed."""
    return {file.distribution: library_version(next(iter(file.solvers))) for file in FILES if file.program}


def all_versions() -> dict[str, str]:
    """Return the versions of the packages of the reference, those that affect a comparison, and the programs."""
    compared = (
        "scipy", "numba", "heyoka", "scikit-sundae", "matplotlib", "jinja2",
        "diffrax", "jax", "jaxlib", "optimistix", "nosnoc", "casadi", "pydiffsol",
    )  # fmt: skip
    return library_versions((*LIBRARIES, *compared)) | program_versions()


def solver(name: str) -> Solver:
    """Import a solver.

    CaseError if the solver or its restart does not exist; UnavailableError if its library is not installed, or its
    entry point holds no solver.
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
    """Load the solver of an entry point, which is either a solver or a function that returns one.

    UnavailableError if it is neither, or cannot be loaded.
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
    except (Exception, SystemExit) as error:  # a third-party module may raise any exception when it is imported
        text = " ".join(str(error).split())
        raise UnavailableError(f"{where} cannot be loaded: {type(error).__name__}: {text}") from error
    if words:
        raise UnavailableError(f"{where} {words}")
    return cast(Solver, found)
