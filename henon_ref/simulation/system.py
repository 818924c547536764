"""A piecewise-smooth system, written in Python or read from a case file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import sympy as sp

from henon_ref.casefile.schema import check_form
from henon_ref.errors import ArgumentError, ExpressionError, HenonRefError
from henon_ref.expressions.evaluation import parse_expression, parse_number
from henon_ref.modes.problem import parameters_in_exponents
from henon_ref.precision import one_at_a_time
from henon_ref.system.problem import MODEL_KEYS, build_system, written_system
from henon_ref.system.python_arguments import (
    Number,
    argument_error,
    as_given,
    explained,
    mapping_of,
    python_number,
    source_of,
    tree_of,
    written_name,
)
from henon_ref.system.source import Source
from henon_ref.system.tree import MappingNode, Node, ScalarNode, child, mapping, merged
from henon_ref.taylor.tape import TIME
from henon_ref.text import listed


class OwnStart(NamedTuple):
    """Start and horizon of a case's reading, as written in the file."""

    initial: dict[str, str]
    start: str
    until: str
    mode: dict[str, int]


class System:
    """Piecewise-smooth system x' = f(t, x, s) with surfaces h_i(t, x) = 0 and signs s_i = sign(h_i).

    The keys are those of a case file's ``system``.

    Parameters
    ----------
    state : sequence of str
        Names of the n states; at most 4,096, and as many surfaces.
    parameters : mapping, optional
        Name -> number, or an expression in other parameters.
    surfaces : mapping, optional
        Sign symbol -> the expression whose sign it is.
    field : sequence
        x', one expression a state, in time ``t``, states, parameters and signs; smooth for each sign at -1 and +1.
    valid : sequence, optional
        The model holds while these expressions are > 0.
    sliding : mapping, optional
        Sign symbol -> ``{"field": [...], "release": [{"when": EXPR, "direction": "rising", "to": -1}]}``: a sliding
        mode that replaces Filippov's, such as static friction (with ``"entry": "inside"``).
    resets : mapping, optional
        Sign symbol -> ``{"when": "falling", "map": {state: EXPR}, "priority": 0}``: the state jumps when the surface
        falls through zero. Each expression is in time and the state before the jump; states without an expression keep
        their values. If a map carries another surface with a reset through zero, that reset follows. If several resets
        are due, the one with the lowest priority (default 0) is applied first.

    Notes
    -----
    Expressions are text or SymPy; SymPy's symbols are matched by name. ``Abs``, ``sign``, ``Max``, ``Min``,
    ``Piecewise`` and ``Heaviside`` are allowed: their kinks and jumps become surfaces. Numbers are int, float, Fraction
    or text, and are exact: a float stands for the decimal number that Python prints, so that 0.1 is 1/10, as in a case
    file. Systems with equal content compare equal, and an equal system is not compiled again.

    Attributes
    ----------
    state : tuple of str
    model : FilippovSystem
        The system as it is integrated.
    tree : MappingNode
        The description that the system was read from.
    initial, start, until, mode
        Start and horizon of the case's reading (:meth:`from_case`), as exact numbers; None for a system from Python.
    own_start : OwnStart
        Start and horizon of the case's reading as written; the defaults of a run.

    Raises
    ------
    HenonRefError
        Also a ValueError, for invalid arguments. The message states what is wrong and what is allowed.

    Examples
    --------
    >>> belt = System(
    ...     state=["x", "v"],
    ...     parameters={"F": 1, "d": 3, "vb": 0.5},
    ...     surfaces={"s": "v - vb"},
    ...     field=["v", "-x - F*s/(1 + d*s*(v - vb))"],
    ... )
    >>> belt
    System(x, v; s: v - vb; F = 1, d = 3, vb = 1/2)
    """

    own_start: OwnStart | None = None

    @explained
    def __init__(
        self,
        state: Sequence[str | sp.Symbol],
        parameters: Mapping[Any, Any] | None = None,
        surfaces: Mapping[Any, Any] | None = None,
        field: Sequence[Any] | None = None,
        valid: Sequence[Any] | None = None,
        sliding: Mapping[Any, Any] | None = None,
        resets: Mapping[Any, Any] | None = None,
    ) -> None:
        if field is None:
            raise ArgumentError("a system needs its 'field', x' of each state, as in field=['v', '-x']")
        names = [written_name(x, "'state'") for x in state] if isinstance(state, list | tuple) else state
        given = {"state": names, "parameters": parameters, "surfaces": surfaces, "field": field, "valid": valid}
        given |= {"sliding": sliding, "resets": resets}
        lists: dict[str, Callable[[Any, str], Node]] = dict.fromkeys(("state", "field", "valid"), tree_of)
        nodes = {key: lists.get(key, mapping_of)(x, f"'{key}'") for key, x in given.items() if x is not None}
        beside = {key: nodes.pop(key) for key in MODEL_KEYS if key in nodes}
        self._read(source_of(mapping({"system": mapping(nodes), **beside})))

    @classmethod
    def from_case(cls, path: str | Path, reading: str | None = None) -> System:
        """Read the system of a case file, with the start and the horizon of one of its readings.

        ``simulate`` uses that start and horizon unless others are given.

        Parameters
        ----------
        path : str or Path
            A case file with a ``system`` or a ``scene``, or the name of a case that is installed with the package, such
            as ``fig8``.
        reading : str, optional
            Name of the reading; by default the first one in the file.

        Raises
        ------
        HenonRefError
            If the file is not a valid case (the message gives file, line and column) or has no such reading.
        """
        if not (reading is None or isinstance(reading, str)):
            raise ArgumentError(f"reading is {str(reading)[:60]!r}; wanted the name of a reading, or None")
        from henon_ref.casefile.case import case_and_sources  # what only files need

        case, sources = case_and_sources(path)
        chosen = case.readings[0] if reading is None else case.reading(reading)
        return cls.from_source(sources[chosen.name])

    @classmethod
    def from_source(cls, source: Source, declared: Sequence[str] = ()) -> System:
        """Read the system of a case file's keys ``system`` or ``scene``, ``sliding`` and ``resets``.

        It has the start and the horizon of the case if it is one. ``declared[k - 1]`` names the declaration on line k,
        for messages; nodes on line 0 have no declaration.
        """
        self = cls.__new__(cls)
        self._read(source, declared)
        if "until" in source.tree.entries:
            initial = {x: source.text(("initial", x)) for x in self.state}
            mode = {name: int(source.text(("initial", "mode", name))) for name in source.keys(("initial", "mode"))}
            self.own_start = OwnStart(initial, source.word(("initial", "t"), "0"), source.text(("until",)), mode)
        return self

    def _read(self, source: Source, declared: Sequence[str] = ()) -> None:
        entries = source.tree.entries
        self.tree = mapping({key: entries[key] for key in MODEL_KEYS if key in entries})
        try:
            check_form(self.tree)
            with one_at_a_time():
                self._written, self.model = written_system(source), build_system(source)
        except HenonRefError as error:
            raise argument_error(error, declared) from None

    @cached_property
    def state(self) -> tuple[str, ...]:
        return self.model.state_names

    @cached_property
    def prepared(self) -> dict[float, Any]:
        """Prepared starts of runs, by tolerance."""
        return {}

    def with_surfaces(self, surfaces: Mapping[sp.Symbol, sp.Expr]) -> System:
        """Return the system with additional surfaces, by sign, on which its field does not depend."""
        other, model = System.__new__(System), self.model
        other.tree, other._written = self.tree, self._written
        surfaces = dict(zip(model.signs, model.surfaces, strict=True)) | dict(surfaces)
        other.model = replace(model, signs=tuple(surfaces), surfaces=tuple(surfaces.values()))
        return other

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "prepared"}

    @property
    def initial(self) -> dict[str, Number] | None:
        own = self.own_start
        return None if own is None else {x: python_number(self.number(value)) for x, value in own.initial.items()}

    @property
    def start(self) -> Number | None:
        return None if self.own_start is None else python_number(self.number(self.own_start.start))

    @property
    def until(self) -> Number | None:
        return None if self.own_start is None else python_number(self.number(self.own_start.until))

    @property
    def mode(self) -> dict[str, int] | None:
        return None if self.own_start is None else dict(self.own_start.mode)

    @property
    def parameters(self) -> dict[str, Number]:
        """Name -> exact number; a copy. :meth:`with_parameters` returns a system with other values."""
        return {name: python_number(value) for name, value in self.model.parameter_values.items()}

    def with_parameters(self, parameters: Mapping[Any, Any]) -> System:
        """Return the system with other values of some parameters; parameters that depend on them are recomputed.

        Parameters
        ----------
        parameters : mapping
            Name -> number, or an expression in other parameters.

        Raises
        ------
        HenonRefError
            If a name is not a parameter, or the system does not allow a value.
        """
        given = mapping_of(parameters, "'parameters'", "parameter", self.model.parameter_values)
        if not given.entries:
            return self
        for name, value in given.entries.items():
            if isinstance(value, ScalarNode) and value.value is None:  # null would remove it
                raise ArgumentError(f"'{name}' in 'parameters' is None; wanted a number or an expression (text)")
        key = "system" if "system" in self.tree.entries else "scene"
        other = System.from_source(source_of(merged(self.tree, mapping({key: mapping({"parameters": given})}))))
        other.own_start = self.own_start
        return other

    def expression(self, value: object, what: str = "the expression") -> sp.Expr:
        """Read an expression in time, states and parameters, with the checks of a case file.

        Parameters
        ----------
        value : str, number or Expr
        what : str
            Name of the expression in error messages.

        Raises
        ------
        HenonRefError
            If it contains a name or function that the system does not have.
        """
        names = {symbol.name: symbol for symbol in (TIME, *self.model.states, *self.model.parameters)}
        return self._parsed(parse_expression, value, names, what)

    def number(self, value: object, what: str = "the number") -> sp.Expr:
        """Read an exact number: a Python or SymPy number, or text in the parameters.

        Raises
        ------
        HenonRefError
            If the value is not a finite real number.
        """
        return self._parsed(parse_number, value, self.model.parameter_values, what)

    def _parsed(self, parse: Callable[..., sp.Expr], value: object, names: Mapping[str, sp.Expr], what: str) -> sp.Expr:
        try:
            return parse(as_given(value, what), names)
        except ExpressionError as error:
            raise ArgumentError(f"{what}: {error.message}") from None

    def with_keys(self, more: Mapping[str, Node]) -> Source:
        """Return the description with more keys of a case, such as ``until``; its system is not built again."""
        source = Source(mapping({**self.tree.entries, **more}))
        source.once("system", MODEL_KEYS, lambda: self.model)
        return source

    @cached_property
    def parameter_expressions(self) -> dict[str, sp.Expr]:
        """Parameter given as text -> its expression in the other parameters."""
        tree = child(self.tree, ["system" if "system" in self.tree.entries else "scene", "parameters"])
        nodes = tree.entries if isinstance(tree, MappingNode) else {}
        given = {n: x.given for n, x in nodes.items() if isinstance(x, ScalarNode) and isinstance(x.value, str)}
        symbols = {symbol.name: symbol for symbol in self.model.parameters}
        return {name: parse_expression(value, symbols) for name, value in given.items()}

    @cached_property
    def exponent_parameters(self) -> frozenset[str]:
        """Parameters that occur in exponents; other values of these change the system's structure."""
        return frozenset(symbol.name for symbol in parameters_in_exponents(self._written))

    @cached_property
    def has_moving_exponents(self) -> bool:
        """Whether an exponent in a surface or a ``valid`` expression depends on time or states."""
        moving, written = {TIME, *self.model.states}, (*self.model.surfaces, *self.model.valid)
        return any(power.exp.free_symbols & moving for e in written for power in e.atoms(sp.Pow))

    @cached_property
    def structure(self) -> tuple[object, ...]:
        """The system without the values of its parameters, in a hashable form."""
        model = self.model
        overrides = tuple(
            (i, o.field, tuple((r.when, r.direction, r.to) for r in o.release), o.entry)
            for i, o in sorted(model.overrides.items())
        )
        resets = tuple((i, tuple(r.map.items()), r.priority) for i, r in sorted(model.resets.items()))
        names = tuple(symbol.name for symbol in model.parameters)
        return model.states, model.signs, model.surfaces, model.field, model.valid, overrides, resets, names

    @cached_property
    def content(self) -> tuple[object, ...]:
        """The system with the values of its parameters, in a hashable form."""
        return self.structure, tuple(self.model.parameters.values())

    def __eq__(self, other: object) -> bool:
        return self.content == other.content if isinstance(other, System) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.content)

    def __repr__(self) -> str:
        from henon_ref.modes.latex import short

        model = self.model
        surfaces = ", ".join(f"{s}: {short(h)}" for s, h in zip(model.sign_names[:4], model.surfaces, strict=False))
        more = ", ..." if len(model.signs) > 4 else ""
        values = listed([f"{name} = {value}" for name, value in self.parameters.items()], 8)
        return f"System({'; '.join(part for part in (listed(self.state, 8), surfaces + more, values) if part)})"

    def _repr_html_(self) -> str:
        from henon_ref.modes.latex import table_html

        return table_html(self.model)
