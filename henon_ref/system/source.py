"""Reading expressions from a case file; errors are reported with line and column of the text."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from typing import TypeVar

import sympy as sp

from henon_ref.errors import CaseError, ExpressionError
from henon_ref.expressions.evaluation import (
    FIELD,
    NUMBER,
    SMOOTH,
    Kinked,
    Written,
    check_sides,
    evaluated,
    read,
)
from henon_ref.expressions.grammar import MAX_STATES, name_problem
from henon_ref.expressions.operations import Work, key_of, overlaid
from henon_ref.system.tree import MappingNode, Place, ScalarNode, SequenceNode, child, locate
from henon_ref.taylor.tape import TIME
from henon_ref.text import did_you_mean, listed

T = TypeVar("T")
WITH_VALUES = " (with the values of the parameters)"
Path = Sequence[str | int]
"""Keys and indices from the top of the file, as ``("system", "field", 0)``."""


@dataclass(frozen=True)
class Source:
    """Tree of a case, or of a reading with its overrides applied, whose nodes know their places in the file."""

    tree: MappingNode
    file: str | None = None
    within: str = ""
    """Suffix of every message: the reading that it is about."""
    work: Work = field(default_factory=Work, compare=False)
    """Cache and cost of the expressions of the file, shared by all readings."""
    most_states: int = MAX_STATES

    def error(self, path: Path, message: str, *, key: bool = False) -> CaseError:
        """Return an error at the value that a path leads to (``key``: at its key)."""
        return self.error_at(locate(self.tree, path, key=key), message)

    def error_at(self, place: Place, message: str) -> CaseError:
        return CaseError(message + self.within, file=self.file, line=place.line, column=place.column)

    def unknown(self, path: Path, what: str, kind: str, known: Collection[str]) -> CaseError:
        """Return an error at an unknown key, with the known names of that kind."""
        return self.error(path, f"{what}{did_you_mean(str(path[-1]), known)}; {kind}: {listed(known)}", key=True)

    def text(self, path: Path) -> str:
        """Return the text of a scalar as written in the file."""
        node = child(self.tree, path)
        if not isinstance(node, ScalarNode):
            raise self.error(path, "must be a number or an expression")
        # In an expression, a number is decimal; hexadecimal and octal numbers of YAML are converted.
        return str(node.value) if isinstance(node.value, int) and node.text[:2] in ("0x", "0o") else node.text

    def plain(self, path: Path) -> str:
        """Return the text of a scalar; empty if there is none."""
        node = child(self.tree, path)
        return node.text if isinstance(node, ScalarNode) else ""

    def keys(self, path: Path) -> list[str]:
        """Return the keys of a mapping; empty if there is no mapping."""
        node = child(self.tree, path)
        return list(node.entries) if isinstance(node, MappingNode) else []

    @property
    def has_scene(self) -> bool:
        """Whether the model is a scene rather than equations."""
        return isinstance(self.tree.entries.get("scene"), MappingNode)

    def length(self, path: Path) -> int:
        """Return the number of entries of a list; 0 if there is no list."""
        node = child(self.tree, path)
        return len(node.items) if isinstance(node, SequenceNode) else 0

    def word(self, path: Path, default: str) -> str:
        """Return the text of a scalar, or a default if it is absent."""
        return default if child(self.tree, path) is None else self.text(path)

    def written(self, path: Path) -> Written:
        """Return an expression as given: text, or SymPy."""
        node = child(self.tree, path)
        return self.text(path) if not isinstance(node, ScalarNode) or isinstance(node.given, str) else node.given

    def expression(
        self, path: Path, names: Mapping[str, sp.Expr], functions: Mapping[str, int], note: str = ""
    ) -> Kinked:
        """Read an expression (see :func:`henon_ref.expressions.evaluation.evaluated`)."""
        with self.at(path, note):
            return evaluated(self.written(path), names, self.work, functions)

    def number(self, path: Path, names: Mapping[str, sp.Expr]) -> sp.Expr:
        """Read an expression whose value is a number (see :func:`henon_ref.expressions.evaluation.parse_number`)."""
        return self.expression(path, names, NUMBER)[0]

    def once(self, what: str, keys: Sequence[str], build: Callable[[], T]) -> T:
        """Return what ``build`` returns for the values of some top-level keys, cached for equal readings."""
        nodes = tuple(self.tree.entries.get(key) for key in keys)
        key, known = (what, *map(id, nodes)), self.work.known
        if key not in known:
            known[key] = nodes, build()  # keep the nodes alive: their ids are part of the key
        found: T = known[key][1]
        return found

    @contextmanager
    def at(self, path: Path, note: str = "") -> Iterator[None]:
        """Convert an ExpressionError into a CaseError at the place of the expression in the file."""
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
        """Return the exact values of a mapping of parameters, which may depend on each other."""
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
            message = f"the parameters depend on each other in a cycle: {' -> '.join(circle)}"
            raise self.error([*path, circle[0]], message) from None
        return {name: values[name] for name in node.entries}


@dataclass(frozen=True)
class Names:
    """Meanings of the names of a case."""

    states: Mapping[str, sp.Symbol]
    signs: Mapping[str, sp.Symbol]
    parameters: Mapping[str, sp.Symbol]
    values: Mapping[str, sp.Expr]
    """Parameter -> exact value."""

    @classmethod
    def of(cls, states: Sequence[str], signs: Sequence[str], values: Mapping[str, sp.Expr]) -> Names:
        return cls(_symbols(states), _symbols(signs), _symbols(list(values)), values)

    def exact_parameters(self) -> dict[sp.Symbol, sp.Expr]:
        return {symbol: self.values[name] for name, symbol in self.parameters.items()}

    def smooth(self, source: Source, path: Path, *, signs: Sequence[str] = ()) -> sp.Expr:
        """Read a smooth expression in time, states, parameters and some signs."""
        return self.written(source, path, signs=signs, functions=SMOOTH)[0]

    def written(
        self, source: Source, path: Path, *, signs: Sequence[str] = (), functions: Mapping[str, int] = FIELD
    ) -> Kinked:
        """Read an expression in time, states, parameters and some signs, which may have kinks.

        It is also evaluated with the values of the parameters, and with each sign at -1 and +1, to find a division by
        zero or a giant power here, with its place in the file, instead of during a run.
        """
        own = {name: self.signs[name] for name in signs}
        found = source.expression(path, overlaid(own, self._symbols), functions)
        if self._is_new(source, path, functions):
            if self.values:
                source.expression(path, overlaid(own, self._numbers), functions, WITH_VALUES)
            with source.at(path):
                check_sides(source.written(path), self._numbers, own, source.work, functions)
        return found

    def _is_new(self, source: Source, path: Path, functions: Mapping[str, int]) -> bool:
        """Check whether no expression equal up to the names of states and signs has been checked yet."""
        known = read(source.written(path), overlaid(self.signs, self._symbols), source.work, functions)
        moving = [name for name in known.names if name in self.states or name in self.signs]
        form = known.renamed({name: f"{'s' if name in self.signs else 'x'}#{k}" for k, name in enumerate(moving)})
        key = "checked", id(functions), key_of("", form, self.values)
        new = key not in source.work.known
        source.work.known[key] = None
        return new

    @cached_property
    def _symbols(self) -> dict[str, sp.Expr]:
        """Name -> symbol, without the signs."""
        return {"t": TIME, **self.states, **self.parameters}

    @cached_property
    def _numbers(self) -> dict[str, sp.Expr]:
        """Name -> symbol of a state, or value of a parameter."""
        return {"t": TIME, **self.states, **self.values}


def _symbols(names: Sequence[str]) -> dict[str, sp.Symbol]:
    return {name: sp.Symbol(name, real=True) for name in names}
