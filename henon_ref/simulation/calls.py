"""Calls that do not fit a function: one error that names what was meant, and what is allowed."""

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
    "method": "there is one method; rtol says how exact it is",
    "atol": "leave it out; rtol is relative to each state's own size, whatever its unit",
    "jac": "derivatives are taken from the system's expressions",
    **dict.fromkeys(("max_step", "min_step", "first_step"), "steps follow from rtol, and pass over no event"),
    **dict.fromkeys(("vectorized", "jac_sparsity", "lband", "uband"), "there is nothing that it could say here"),
}
"""Arguments of SciPy's solve_ivp -> what is written here, in functions that take ``rtol``."""


class CallError(ArgumentError, TypeError):
    """Arguments that a function does not have, or lacks."""


def explained(function: Callable[P, R]) -> Callable[P, R]:
    """The function; a call that does not fit it raises a :class:`CallError` that says what does."""

    @wraps(function)
    def called(*arguments: P.args, **options: P.kwargs) -> R:
        try:
            return function(*arguments, **options)
        except TypeError as error:
            if error.__traceback__ is None or error.__traceback__.tb_next is not None:  # it arose within
                raise
            raise CallError(_misfit(function, arguments, options) or str(error)) from None

    return called


def explained_methods(cls: type[C]) -> type[C]:
    """The class; calls of it and of its public methods are explained likewise."""
    for name, own in list(vars(cls).items()):
        if isfunction(own) and (name == "__init__" or not name.startswith("_")):
            setattr(cls, name, explained(own))
    return cls


def check_words(function: str, given: Iterable[str], known: Sequence[str], others: Sequence[str] = ()) -> None:
    """Refuse words that a function has no arguments of; ``others`` are known, too, but too many to be listed."""
    for word in given:
        if word not in known and word not in others:
            meant = did_you_mean(word, [*known, *others])
            more = " and matplotlib's keywords" if others else ""
            raise CallError(f"{function} has no argument '{word[:60]}'{meant}; it takes {listed(known, 20)}{more}")


def _misfit(function: Callable[..., Any], arguments: Sequence[Any], options: Mapping[str, Any]) -> str:
    """What is wrong with a call; empty where something is missing, which Python's own words say."""
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
