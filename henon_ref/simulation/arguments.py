"""The arguments of a run, read as a case file's ``initial`` and ``until`` are, to an initial-value problem."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from numbers import Integral, Real
from typing import Any

import numpy as np

from henon_ref.casefile.problem import build_problem
from henon_ref.casefile.schema import check_form
from henon_ref.casefile.source import Source
from henon_ref.casefile.tree import MappingNode, Node
from henon_ref.errors import ArgumentError, HenonRefError
from henon_ref.modes.problem import Problem
from henon_ref.precision import one_at_a_time
from henon_ref.simulation.system import System
from henon_ref.simulation.written import argument_error, mapping, tree_of, written, written_name
from henon_ref.text import did_you_mean, listed, shortened

DIRECTIONS = ("falling", "rising")
STOPS = 63
"""Surfaces, of the first ones, on which a run can be stopped: bits of a positive whole number."""
SMALLEST, LARGEST = 1e-16, 1.0
"""Between these lies a tolerance, as in a case file."""

SCIPY = {
    "t_eval": "the run is known at every time: write run.sol(times), or run.to_dataframe(times)",
    "args": "parameters go by name: System(..., parameters={'F': 1}), and simulate(..., parameters={'F': 2})",
    "t_span": "write until=10, and start=1 where it does not begin at 0",
    "y0": "write initial={'x': 1, 'v': 0}",
    "events": "every surface of the system is located: see run.transitions; stop={'s': 'falling'} ends the run on one",
    "method": "there is one method; rtol says how exact it is",
    "jac": "derivatives are taken from the system's expressions",
    **dict.fromkeys(("max_step", "min_step", "first_step"), "steps follow from rtol, and pass over no event"),
    **dict.fromkeys(("vectorized", "jac_sparsity", "lband", "uband"), "there is nothing that it could say here"),
}
"""Arguments of SciPy's solve_ivp -> what is written here."""


def refuse(function: str, others: Mapping[str, Any]) -> None:
    """Refuse arguments that a function does not have.

    Raises
    ------
    ArgumentError
        For those of SciPy's solve_ivp, saying what to write.
    TypeError
        For others, as Python does.
    """
    for name in others:
        if name in SCIPY:
            raise ArgumentError(f"{function} has no argument '{name}': {SCIPY[name]}")
    raise TypeError(f"{function}() got an unexpected keyword argument '{next(iter(others))}'")


def start_of(
    system: System, initial: Any, until: Any, start: Any, mode: Mapping[Any, Any] | None
) -> tuple[Any, Any, Any, Mapping[Any, Any] | None]:
    """Initial values by their states, horizon, initial time and mode of a run; of the case for what is not given.

    The mode of the case belongs to its initial values.

    Raises
    ------
    ArgumentError
        For a system that has none of its own, and for more or fewer values than it has states.
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
) -> tuple[System, Problem]:
    """The system of a run and its initial-value problem, in exact numbers.

    Parameters
    ----------
    system, initial, until, start, parameters, mode
        As in :func:`henon_ref.simulation.simulate.simulate`.

    Raises
    ------
    ArgumentError
        For a missing or unknown state, a number that is not finite, an unknown parameter, a horizon that is not later
        than the start, and a mode of an unknown surface, or one that the start contradicts.
    """
    initial, until, start, mode = start_of(system, initial, until, start, mode)
    if parameters:
        system = system.with_parameters(parameters)
    given = _mapping(initial, "'initial'", "state", system.state)
    entry = _mapping({} if mode is None else mode, "'mode'", "surface", system.model.sign_names)
    entries: dict[str, Node] = {"t": tree_of(written(start, "'start'"), "'start'"), **given.entries, "mode": entry}
    read = {"initial": mapping(entries), "until": tree_of(written(until, "'until'"), "'until'")}
    source = Source(mapping({**system.tree.entries, **read}), work=system.work())
    try:
        with one_at_a_time():
            check_form(source.tree)
            return system, build_problem(source)[0]
    except HenonRefError as error:
        raise argument_error(error) from None


def _mapping(value: object, what: str, kind: str, known: tuple[str, ...]) -> MappingNode:
    """A mapping of known names."""
    node = tree_of(value, what)
    if not isinstance(node, MappingNode):
        others = ", or an array with a value for each state" if kind == "state" else ""
        raise ArgumentError(f"{what} must be a mapping, as in {{{known[0] if known else 's'!r}: 0}}{others}")
    for name in node.entries:
        if name not in known:
            raise ArgumentError(f"'{name[:60]}' is no {kind}{did_you_mean(name, known)}; {kind}s: {listed(known)}")
    return node


def tolerance_of(value: Any) -> float:
    """A relative tolerance as a double.

    Raises
    ------
    ArgumentError
        For what is no number between 1e-16 and 1.
    """
    if isinstance(value, str):
        raise ArgumentError(f"rtol is text, {shortened(value)}; wanted a number without quotes, as in rtol=1e-9")
    if _is_number(value) and SMALLEST <= value < LARGEST:
        return float(value)
    raise ArgumentError(f"rtol is {str(value)[:60]}; a tolerance is a number from 1e-16 to below 1")


def whole_number(value: Any, what: str) -> int:
    """A number of things, from 1 on.

    Raises
    ------
    ArgumentError
        For anything else.
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or value < 1:
        raise ArgumentError(f"{what} is {str(value)[:60]}; wanted a whole number from 1 on")
    return int(value)


def check_absolute_tolerance(value: Any) -> None:
    """Check the absolute tolerance, which is not used: steps go by each state's own size.

    Raises
    ------
    ArgumentError
        For what is not a positive number.
    """
    if value is not None and not (_is_number(value) and 0 < value < math.inf):
        raise ArgumentError(f"atol is {str(value)[:60]}; wanted a number larger than 0, or None")


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def stop_of(system: System, stop: Mapping[Any, Any]) -> tuple[int, int]:
    """Surfaces that end a run where they are reached from above, and from below: a bit each, by their index.

    Raises
    ------
    ArgumentError
        For an unknown surface or direction.
    """
    names = system.model.sign_names
    _mapping(stop, "'stop'", "surface", names)
    bits = dict.fromkeys(DIRECTIONS, 0)
    for name, direction in stop.items():
        index = names.index(written_name(name, "'stop'"))
        if direction not in DIRECTIONS:
            raise ArgumentError(f"'stop' at '{names[index]}' is {str(direction)[:60]!r}; wanted 'falling' or 'rising'")
        if index >= STOPS:
            raise ArgumentError(f"'{names[index]}' is beyond the first {STOPS} surfaces, on which a run can be stopped")
        bits[direction] |= 1 << index
    return bits["falling"], bits["rising"]
