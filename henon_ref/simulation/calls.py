"""Errors of calls with wrong arguments: one message with the probable and the allowed names."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import wraps
from inspect import Parameter, isfunction, signature
from typing import Any, ParamSpec, TypeVar

from henon_ref.errors import ArgumentError
from henon_ref.text import did_you_mean, listed

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C")

SCIPY = {
    "t_eval": "the run is known at every time: write run.sol(times), or run.to_dataframe(times)",
    "args": "parameters go by name: System(..., parameters={'F': 1}), and simulate(..., parameters={'F': 2})",
    "t_span": "write until=10, and start=1 where it does not begin at 0",
    "y0": "write initial={'x': 1, 'v': 0}",
    "events": "every surface of the system is located: see run.transitions; stop={'s': 'falling'} ends the run on one",
    "method": "leave it out; there is one method, whose accuracy rtol sets",
    "atol": "leave it out; rtol is relative to each state's own size, whatever its unit",
    "jac": "derivatives are taken from the system's expressions",
    **dict.fromkeys(("max_step", "min_step", "first_step"), "steps follow from rtol, and pass over no event"),
    **dict.fromkeys(("vectorized", "jac_sparsity", "lband", "uband"), "leave it out; it has no equivalent here"),
}
"""Arguments of SciPy's solve_ivp -> the equivalent here, for functions with ``rtol``."""


class CallError(ArgumentError, TypeError):
    """Unknown or missing arguments of a function."""


def explained(function: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function: a call with unknown or missing arguments raises a :class:`CallError`."""

    @wraps(function)
    def called(*arguments: P.args, **options: P.kwargs) -> R:
        try:
            return function(*arguments, **options)
        except TypeError as error:
            if error.__traceback__ is None or error.__traceback__.tb_next is not None:  # raised inside the function
                raise
            raise CallError(_misfit(function, arguments, options) or str(error)) from None

    return called


def explained_methods(cls: type[C]) -> type[C]:
    """Decorate the constructor and the public methods of a class with :func:`explained`."""
    for name, own in list(vars(cls).items()):
        if isfunction(own) and (name == "__init__" or not name.startswith("_")):
            setattr(cls, name, explained(own))
    return cls


def check_words(function: str, given: Iterable[str], known: Sequence[str], others: Sequence[str] = ()) -> None:
    """Raise CallError for an unknown keyword; ``others`` are also allowed, but not listed in the message."""
    for word in given:
        if word not in known and word not in others:
            meant = did_you_mean(word, [*known, *others])
            more = " and matplotlib's keywords" if others else ""
            raise CallError(f"{function} has no argument '{word[:60]}'{meant}; it takes {listed(known, 20)}{more}")


def _misfit(function: Callable[..., Any], arguments: Sequence[Any], options: Mapping[str, Any]) -> str:
    """Return the message for a wrong call; empty if an argument is missing (Python's message is used)."""
    name = function.__qualname__.removesuffix(".__init__")
    parameters = signature(function).parameters
    own, given = [p for p in parameters.values() if p.name != "self"], len(arguments) - ("self" in parameters)
    known = [p.name for p in own]
    for word in options:
        if word in SCIPY and word not in known and "rtol" in known:
            return f"{name} has no argument '{word}': {SCIPY[word]}"
    check_words(name, options, known)
    places = [p.name for p in own if p.kind == Parameter.POSITIONAL_OR_KEYWORD]
    by_name = [p.name for p in own if p.kind == Parameter.KEYWORD_ONLY]
    if given > len(places) and by_name:
        return f"{name} takes {listed(places)} without a name; write what follows by name, as in {by_name[0]}=..."
    return ""
