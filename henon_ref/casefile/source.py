"""Expressions read from a case file, each error at the line and column where its text stands."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from typing import TypeVar

import sympy as sp

from henon_ref.casefile.expressions import (
    FIELD,
    KINKED,
    NUMBER,
    SMOOTH,
    Written,
    check_sides,
    parse_expression,
    parse_field,
    parse_number,
    read,
)
from henon_ref.casefile.grammar import MAX_STATES, may_have_kinks, name_problem
from henon_ref.casefile.tree import MappingNode, Place, ScalarNode, SequenceNode, child, locate
from henon_ref.casefile.work import Work, key_of, overlaid
from henon_ref.errors import CaseError, ExpressionError
from henon_ref.taylor.tape import TIME
from henon_ref.text import did_you_mean, listed

T = TypeVar("T")
WITH_VALUES = " (with the values of the parameters)"
Path = Sequence[str | int]
"""Keys and indices from the top of the file, as ``("system", "field", 0)``."""


@dataclass(frozen=True)
class Source:
    """One case, or one reading of it with its overrides laid over, as a tree that knows its places."""

    tree: MappingNode
    file: str | None = None
    within: str = ""
    """Added to every message: which reading it is about."""
    work: Work = field(default_factory=Work, compare=False)
    """What has been read of the file so far, in all readings."""
    most_states: int = MAX_STATES
    """States, and surfaces, that it may have."""

    def error(self, path: Path, message: str, *, key: bool = False) -> CaseError:
        """An error at what a path leads to (``key``: at its key rather than its value)."""
        return self.error_at(locate(self.tree, path, key=key), message)

    def error_at(self, place: Place, message: str) -> CaseError:
        """An error at a place."""
        return CaseError(message + self.within, file=self.file, line=place.line, column=place.column)

    def unknown(self, path: Path, what: str, kind: str, known: Collection[str]) -> CaseError:
        """An error at a key that is none of those known, which are of a kind."""
        return self.error(path, f"{what}{did_you_mean(str(path[-1]), known)}; {kind}: {listed(known)}", key=True)

    def text(self, path: Path) -> str:
        """The text of a scalar as it is written."""
        node = child(self.tree, path)
        if not isinstance(node, ScalarNode):
            raise self.error(path, "must be a number or an expression")
        # A number in a base other than ten is not one in an expression.
        return str(node.value) if isinstance(node.value, int) and node.text[:2] in ("0x", "0o") else node.text

    def keys(self, path: Path) -> list[str]:
        """The keys of a mapping, none where there is no mapping."""
        node = child(self.tree, path)
        return list(node.entries) if isinstance(node, MappingNode) else []

    @property
    def has_scene(self) -> bool:
        """Whether the model is a scene, not a system that is written out."""
        return isinstance(self.tree.entries.get("scene"), MappingNode)

    def length(self, path: Path) -> int:
        """How many entries a list has, 0 where there is no list."""
        node = child(self.tree, path)
        return len(node.items) if isinstance(node, SequenceNode) else 0

    def word(self, path: Path, default: str) -> str:
        """A word of the file, or what stands for it where it is left out."""
        node = child(self.tree, path)
        return default if node is None else self.text(path)

    def written(self, path: Path) -> Written:
        """An expression as it is given: text, or SymPy."""
        node = child(self.tree, path)
        return self.text(path) if not isinstance(node, ScalarNode) or isinstance(node.given, str) else node.given

    def has_kinks(self, path: Path) -> bool:
        """Whether an expression has a function with a kink or a jump."""
        written = self.written(path)
        return may_have_kinks(written) if isinstance(written, str) else written.has(*KINKED)

    def expression(self, path: Path, names: Mapping[str, sp.Expr], note: str = "") -> sp.Expr:
        """A smooth expression (see :func:`henon_ref.casefile.expressions.parse_expression`)."""
        with self.at(path, note):
            return parse_expression(self.written(path), names, self.work)

    def field(self, path: Path, names: Mapping[str, sp.Expr], note: str = "") -> tuple[sp.Expr, list[sp.Expr]]:
        """A component of a field, which may have kinks (see :func:`henon_ref.casefile.expressions.parse_field`)."""
        with self.at(path, note):
            return parse_field(self.written(path), names, self.work)

    def number(self, path: Path, names: Mapping[str, sp.Expr]) -> sp.Expr:
        """An expression whose value is a number (see :func:`henon_ref.casefile.expressions.parse_number`)."""
        with self.at(path):
            return parse_number(self.written(path), names, self.work)

    def once(self, what: str, keys: Sequence[str], build: Callable[[], T]) -> T:
        """What is built of the values of some keys at the top, once for all readings that have the same ones."""
        nodes = tuple(self.tree.entries.get(key) for key in keys)
        known = (what, *map(id, nodes))
        if known not in self.work.built:
            self.work.built[known] = nodes, build()  # the nodes are kept, so that none of another reading has their id
        found: T = self.work.built[known][1]
        return found

    @contextmanager
    def at(self, path: Path, note: str = "") -> Iterator[None]:
        """Say of what is wrong with an expression where it stands."""
        try:
            yield
        except ExpressionError as error:
            name = next((str(part) for part in reversed(path) if isinstance(part, str)), "")
            message, node = f"in '{name}': {error.message}{note}", child(self.tree, path)
            start = node.text_place if isinstance(node, ScalarNode) else None
            if start is None:
                raise self.error(path, message) from None
            raise self.error_at(Place(start.line, start.column + error.offset), message) from None

    def parameters(self, path: Path) -> dict[str, sp.Expr]:
        """Exact values of a mapping of parameters, each of which may use the others."""
        node = child(self.tree, path)
        if not isinstance(node, MappingNode):
            return {}
        uses: dict[str, set[str]] = {}
        for name in node.entries:
            problem = name_problem(name, parameter=True)
            if problem:
                raise self.error([*path, name], problem, key=True)
            with self.at([*path, name]):
                found = read(self.written([*path, name]), node.entries, self.work, NUMBER).names
            uses[name] = {other for other in found if other in node.entries}
        values: dict[str, sp.Expr] = {}
        try:
            for name in TopologicalSorter(uses).static_order():
                values[name] = self.number([*path, name], values)
        except CycleError as error:
            circle = list(reversed(error.args[1]))
            message = f"parameters depend on each other in a circle: {' -> '.join(circle)}"
            raise self.error([*path, circle[0]], message) from None
        return {name: values[name] for name in node.entries}


@dataclass(frozen=True)
class Names:
    """What the names of one case stand for."""

    states: Mapping[str, sp.Symbol]
    signs: Mapping[str, sp.Symbol]
    parameters: Mapping[str, sp.Symbol]
    values: Mapping[str, sp.Expr]
    """Parameter -> exact number."""

    @classmethod
    def of(cls, states: Sequence[str], signs: Sequence[str], values: Mapping[str, sp.Expr]) -> Names:
        """Real symbols for all names."""
        return cls(_symbols(states), _symbols(signs), _symbols(list(values)), values)

    def exact_parameters(self) -> dict[sp.Symbol, sp.Expr]:
        """Parameter symbol -> exact number."""
        return {symbol: self.values[name] for name, symbol in self.parameters.items()}

    def smooth(self, source: Source, path: Path, *, signs: Sequence[str] = ()) -> sp.Expr:
        """Read an expression in time, states, parameters and some signs.

        It is read with the parameters' values put in as well, and with each sign at -1 and +1, so that
        a division by zero or a giant power is found here, with its place, and not in the middle of a run.
        """
        return self._checked(source, path, signs, source.expression, SMOOTH)

    def written(self, source: Source, path: Path, *, signs: Sequence[str] = ()) -> tuple[sp.Expr, list[sp.Expr]]:
        """Read an expression that may have kinks, and what they are kinks of; checked as in :meth:`smooth`."""
        return self._checked(source, path, signs, source.field, FIELD)

    def _checked(
        self,
        source: Source,
        path: Path,
        signs: Sequence[str],
        worked_out: Callable[..., T],
        functions: Mapping[str, int],
    ) -> T:
        own = {name: self.signs[name] for name in signs}
        found = worked_out(path, overlaid(own, self._symbols))
        if self._is_new(source, path, functions):
            if self.values:
                worked_out(path, overlaid(own, self._numbers), WITH_VALUES)
            with source.at(path):
                check_sides(source.written(path), self._numbers, own, source.work, kinks=functions is FIELD)
        return found

    def _is_new(self, source: Source, path: Path, functions: Mapping[str, int]) -> bool:
        """Whether nothing that says the same of other states and signs has been checked with the parameters' values."""
        known = read(source.written(path), overlaid(self.signs, self._symbols), source.work, functions)
        moving = [name for name in known.names if name in self.states or name in self.signs]
        form = known.renamed({name: f"{'s' if name in self.signs else 'x'}#{k}" for k, name in enumerate(moving)})
        key = "checked", id(functions), key_of("", form, self.values)
        new = key not in source.work.known
        source.work.known[key] = None
        return new

    @cached_property
    def _symbols(self) -> dict[str, sp.Expr]:
        """What the names of an expression stand for, signs apart."""
        return {"t": TIME, **self.states, **self.parameters}

    @cached_property
    def _numbers(self) -> dict[str, sp.Expr]:
        """The same with the values of the parameters."""
        return {"t": TIME, **self.states, **self.values}


def _symbols(names: Sequence[str]) -> dict[str, sp.Symbol]:
    return {name: sp.Symbol(name, real=True) for name in names}
