"""``system:`` and ``sliding:`` of a case file to a :class:`FilippovSystem`."""

from __future__ import annotations

from collections.abc import Collection

import sympy as sp

from henon_ref.casefile.grammar import TAKEN, name_problem
from henon_ref.casefile.source import Names, Path, Source
from henon_ref.modes.switched_field import Release, Reset, SlidingOverride
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME
from henon_ref.text import did_you_mean, listed

KINK_IN_MAP = (
    "a map has no kinks and no signs: write the branch that is in force where the surface falls (of a speed v that is "
    "negative there abs(v) is -v)"
)


def build_system(source: Source) -> tuple[FilippovSystem, Names]:
    """The system that a case file writes out.

    Raises
    ------
    CaseError
        At the place of a name that is taken or not known, an expression that is not allowed, or a field
        whose length is not that of the state.
    """
    states = [source.text(("system", "state", i)) for i in range(source.length(("system", "state")))]
    signs, rates_given = source.keys(("system", "surfaces")), source.length(("system", "field"))
    values = source.parameters(("system", "parameters"))
    _check_names(source, states, signs, set(values))
    names = Names.of(states, signs, values)
    if rates_given != len(states):
        raise source.error(("system", "field"), _wrong_length(rates_given, states))
    surfaces = {names.signs[name]: _surface_of(source, names, name) for name in signs}
    rates = [names.written(source, ("system", "field", i), signs=signs) for i in range(rates_given)]
    made = {sign: surface for sign, (surface, _) in surfaces.items()}
    field, kinks, sections = [rate for rate, _ in rates], frozenset[int](), tuple[sp.Expr, ...]()
    if any(arguments for _, arguments in (*surfaces.values(), *rates)):
        from henon_ref.casefile.model_kinks import with_kinks  # many models have none

        made, field, kinks, sections = with_kinks(source, names, surfaces, rates)
        names = Names.of(states, [sign.name for sign in made], values)
    valid = [names.smooth(source, ("system", "valid", i)) for i in range(source.length(("system", "valid")))]
    places: dict[sp.Symbol, Path] = {x: ("system", "field", i) for i, x in enumerate(names.states.values())}
    places |= {names.signs[name]: ("system", "surfaces", name) for name in signs}
    system = FilippovSystem(
        states=tuple(names.states.values()),
        signs=tuple(names.signs.values()),
        surfaces=tuple(made.values()),
        field=tuple(field),
        parameters=names.exact_parameters(),
        valid=tuple(valid),
        kinks=kinks,
        sections=sections,
        written={s: text for s, path in places.items() if isinstance(text := source.written(path), str)},
    )
    return system, names


def _surface_of(source: Source, names: Names, name: str) -> tuple[sp.Expr, list[sp.Expr]]:
    """A surface, and what it has kinks for."""
    path: Path = ("system", "surfaces", name)
    found = names.written(source, path)
    if not found[0].free_symbols & {TIME, *names.states.values()}:
        raise source.error(path, f"the surface '{name}' never changes: it holds no state and no t")
    return found


def _check_names(source: Source, states: list[str], signs: list[str], parameters: set[str]) -> None:
    seen: dict[str, str] = dict.fromkeys(parameters, "parameter")
    for kind, found in (("state", states), ("surface", signs)):
        for i, name in enumerate(found):
            path: Path = ("system", "state", i) if kind == "state" else ("system", "surfaces", name)
            problem = name_problem(name)
            if not problem and name in seen:
                problem = f"'{name}' is already the name of a {seen[name]}"
            if not problem and kind == "state" and name in TAKEN:
                problem = f"'{name}' is a column of transitions.csv, where states have theirs; choose another name"
            if problem:
                raise source.error(path, problem, key=True)
            seen[name] = kind


def build_overrides(source: Source, names: Names) -> dict[int, SlidingOverride]:
    """The sliding modes that the case does in its own way, by the index of their surface."""
    overrides = {}
    for sign in source.keys(("sliding",)):
        index = _surface(source, names, ("sliding", sign), "sliding of one's own")
        overrides[index] = _override(source, sign, names)
    return overrides


def _surface(source: Source, names: Names, path: tuple[str, str], what: str) -> int:
    """Index of the surface that a key names, which has no kinks."""
    order, sign = list(names.signs), path[1]
    if sign not in order:
        message = f"'{sign}' is no surface{did_you_mean(sign, order)}; surfaces: {listed(order)}"
        raise source.error(path, message, key=True)
    own = source.keys(("system", "surfaces"))
    if sign in own and f"{sign}_2" in order and f"{sign}_2" not in own:
        raise source.error(path, f"{what} on '{sign}', whose surface has kinks, is not there yet", key=True)
    return order.index(sign)


def build_resets(source: Source, names: Names, system: FilippovSystem) -> dict[int, Reset]:
    """The jumps of the state, by the index of their surface.

    Raises
    ------
    CaseError
        At the place of a surface or state that there is not, of a surface that slides in its own way, or of a map that
        leaves every state as it is.
    """
    resets = {}
    for sign in source.keys(("resets",)):
        path = ("resets", sign)
        index = _surface(source, names, path, "a reset")
        if index in system.resets:
            raise source.error(path, f"'{sign}' is a hard stop of the scene, which has its own reset", key=True)
        if index in system.overrides:
            message = f"'{sign}' has sliding of its own; a surface has that or a reset"
            raise source.error(path, message, key=True)
        if index in system.kinks:
            raise source.error(path, f"'{sign}' is a kink of the field; a reset is on a surface", key=True)
        values = {}
        for name in source.keys((*path, "map")):
            place = (*path, "map", name)
            if name not in names.states:
                message = f"'{name}' is no state{did_you_mean(name, names.states)}; states: {listed(names.states)}"
                raise source.error(place, message, key=True)
            if source.has_kinks(place):
                raise source.error(place, f"in '{name}': {KINK_IN_MAP}")
            values[names.states[name]] = names.smooth(source, place)
        if all(x == value for x, value in values.items()):
            raise source.error((*path, "map"), "the map leaves every state as it is; leave the reset out", key=True)
        resets[index] = Reset(values, priority=float(source.word((*path, "priority"), "0")))
    return resets


def _override(source: Source, sign: str, names: Names) -> SlidingOverride:
    others = [name for name in names.signs if name != sign]
    path = ("sliding", sign)
    rates = source.length((*path, "field"))
    if rates != len(names.states):
        raise source.error((*path, "field"), _wrong_length(rates, names.states))
    field = [names.smooth(source, (*path, "field", i), signs=others) for i in range(rates)]
    releases = []
    for i in range(source.length((*path, "release"))):
        when = names.smooth(source, (*path, "release", i, "when"), signs=others)
        rising = source.text((*path, "release", i, "direction")) == "rising"
        releases.append(Release(when, "rising" if rising else "falling", int(source.text((*path, "release", i, "to")))))
    inside = source.word((*path, "entry"), "attracting") == "inside"
    return SlidingOverride(tuple(field), tuple(releases), "inside" if inside else "attracting")


def _wrong_length(rates: int, states: Collection[str]) -> str:
    return f"'field' has {rates} entries; it needs one for each state ({len(states)}): {listed(states)}"
