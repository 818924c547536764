"""Arguments of a run, read as a case file's ``initial`` and ``until``, and the initial-value problem they define."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.casefile.schema import check_form
from henon_ref.errors import ArgumentError, HenonRefError
from henon_ref.integrator.integrator import RUN_ERROR
from henon_ref.modes.problem import Problem
from henon_ref.precision import one_at_a_time
from henon_ref.simulation.system import System
from henon_ref.system.problem import build_problem
from henon_ref.system.python_arguments import (
    argument_error,
    mapping_of,
    tree_of,
    without_dimensions,
    written,
    written_name,
)
from henon_ref.system.tree import MappingNode, Node, mapping
from henon_ref.text import listed, shortened

STOPS = 63
"""Number of surfaces on which a run can be stopped (the first ones): bits of a positive int64."""


def check_system(system: object) -> None:
    """Raise ArgumentError if a system is not a System."""
    if not isinstance(system, System):
        example = ", such as System(['x', 'v'], field=['v', '-x']): the field as text, not a function"
        meant = ": write scene.system()" if hasattr(system, "system") else example if callable(system) else ""
        raise ArgumentError(f"system is {str(system)[:60]!r}; wanted a System{meant}")


def start_of(
    system: System, initial: Any, until: Any, start: Any, mode: Mapping[Any, Any] | None
) -> tuple[Any, Any, Any, Mapping[Any, Any] | None]:
    """Return initial values by state, horizon, initial time and mode of a run; defaults are those of the case.

    The mode of the case is used only with its initial values.
    """
    own = system.own_start
    if (initial is None or until is None) and own is None:
        missing, what = ("'initial'", "initial values") if initial is None else ("'until'", "a horizon")
        raise ArgumentError(f"{missing} is missing: only a system from a case has {what} of its own")
    if own is not None:
        mode = own.mode if mode is None and initial is None else mode
        initial = own.initial if initial is None else initial
        until = own.until if until is None else until
        start = own.start if start is None else start
    if isinstance(initial, np.ndarray | list | tuple):
        values = np.asarray(initial, dtype=object)
        if values.shape != (len(system.state),):
            wanted = f"a value for each of {listed(system.state)}, in this order"
            raise ArgumentError(f"'initial' has the shape {values.shape}; wanted {wanted}")
        if np.ma.is_masked(initial):
            raise ArgumentError(f"'initial' is {initial}; wanted a number for each of {listed(system.state)}")
        initial = dict(zip(system.state, values.tolist(), strict=True))
    return initial, until, 0 if start is None else start, mode


def problem_of(
    system: System,
    initial: Mapping[Any, Any] | Sequence[Any] | None = None,
    *,
    until: object = None,
    start: object = None,
    parameters: Mapping[Any, Any] | None = None,
    mode: Mapping[Any, Any] | None = None,
    error: float = 0.0,
) -> tuple[System, Problem]:
    """Return the system of a run and its initial-value problem in exact numbers.

    The arguments are those of :func:`henon_ref.simulate`; ArgumentError if one of them is invalid. ``error``: local
    error of a step, for a start in a given mode (:data:`henon_ref.integrator.integrator.RUN_ERROR`).
    """
    check_system(system)
    initial, until, start, mode = start_of(system, initial, until, start, mode)
    if parameters is not None:
        system = system.with_parameters(parameters)
    given = _mapping(initial, "'initial'", "state", system.state)
    entry = _mapping({} if mode is None else mode, "'mode'", "surface", system.model.sign_names)
    entries: dict[str, Node] = {"t": tree_of(written(start, "'start'"), "'start'"), **given.entries, "mode": entry}
    read = {"initial": mapping(entries), "until": tree_of(written(until, "'until'"), "'until'")}
    source = system.with_keys(read)
    try:
        with one_at_a_time():
            check_form(source.tree)
            return system, build_problem(source, RUN_ERROR * error)
    except HenonRefError as error:
        raise argument_error(error) from None


def _mapping(value: object, what: str, kind: str, known: tuple[str, ...], entry: object = 0) -> MappingNode:
    """Return a mapping as a tree node; ArgumentError if a name is not known."""
    others = ", or an array with a value for each state" if kind == "state" else ""
    return mapping_of(value, what, kind, known, f"{{{known[0] if known else 's'!r}: {entry!r}}}{others}")


def tolerance_of(value: Any) -> float:
    """Return a relative tolerance as a double; ArgumentError unless it is a number from 1e-16 to below 1."""
    value = without_dimensions(value)
    if isinstance(value, str):
        raise ArgumentError(f"rtol is text, {shortened(value)}; wanted a number without quotes, as in rtol=1e-9")
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    if is_number and 1e-16 <= value < 1.0:
        return float(value)
    raise ArgumentError(f"rtol is {str(value)[:60]}; a tolerance is a number from 1e-16 to below 1")


def whole_number(value: Any, what: str, least: int = 1, most: int | None = None) -> int:
    """Return a whole number within bounds; ArgumentError for anything else."""
    value = without_dimensions(value)
    whole = isinstance(value, Integral) and not isinstance(value, bool)
    if not (whole and least <= value and (most is None or value <= most)):
        bounds = f"of at least {least}" if most is None else f"from {least} to {most}"
        raise ArgumentError(f"{what} is {str(value)[:60]}; wanted a whole number {bounds}")
    return int(value)


def stop_of(system: System, stop: Mapping[Any, Any]) -> tuple[int, int]:
    """Return the surfaces that end a run, as bit masks by index: those reached from above, and from below."""
    names = system.model.sign_names
    _mapping(stop, "'stop'", "surface", names, "falling")
    bits = {"falling": 0, "rising": 0}
    for name, direction in stop.items():
        index = names.index(written_name(name, "'stop'"))
        if not isinstance(direction, str) or direction not in bits:
            raise ArgumentError(f"'stop' at '{names[index]}' is {str(direction)[:60]!r}; wanted 'falling' or 'rising'")
        if index >= STOPS:
            raise ArgumentError(f"'{names[index]}' is beyond the first {STOPS} surfaces, on which a run can be stopped")
        bits[direction] |= 1 << index
    return bits["falling"], bits["rising"]


def numbers(given: Any, what: str) -> NDArray[np.float64]:
    """Return finite numbers as a one-dimensional array; ArgumentError if they are not."""
    if isinstance(given, str | bytes | Mapping):
        raise ArgumentError(f"{what} is {str(given)[:60]!r}; wanted a list or array of numbers")
    try:
        array = np.asarray(given if hasattr(given, "__len__") else list(given))
        texts = array.dtype.kind == "O" and any(isinstance(value, str | bytes) for value in array.ravel())
        if array.dtype.kind in "bcmMUS" or texts or np.ma.is_masked(given):  # NumPy would make numbers of these
            raise TypeError
        values = np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ArgumentError(f"{what} is {str(given)[:60]}; wanted a list or array of numbers") from None
    if values.ndim != 1:
        raise ArgumentError(f"{what} has the shape {values.shape}; wanted a list or array of numbers")
    wrong = np.flatnonzero(~np.isfinite(values))
    if wrong.size:
        raise ArgumentError(f"{what} holds {values[wrong[0]]} at place {wrong[0] + 1}; a number must be finite")
    return values
