"""Straight-line code cut into pieces, one per order, which store the values that later pieces read."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from henon_ref.jit.ir_writer import ZERO, IRWriter, Value

CHEAP = 3
"""Largest number of operations for which a value is computed again instead of stored."""
_DEFINED = re.compile(r"  (%v\d+) = (.*)")
_NAME = re.compile(r"%v\d+")
_FREE = re.compile(r"getelementptr|load")
_SHORT = re.compile(r"fneg|fadd|fsub|fmul|insertelement|shufflevector|extractelement")
_VECTOR = re.compile(r"<\d+ x double>")


class Pieces(NamedTuple):
    """Lines of each piece, and the number of doubles of memory that the pieces use."""

    lines: list[list[str]]
    room: int


class PiecewiseWriter(IRWriter):
    """Writer of instructions in pieces."""

    def __init__(self) -> None:
        super().__init__()
        self._starts: list[int] = []

    def begin(self) -> None:
        self._starts.append(len(self.lines))

    def pieces(self, results: Mapping[int, tuple[int, Value]], own: str, room: int) -> Pieces:
        """Return the written code as pieces that can be compiled separately.

        Parameters
        ----------
        results : mapping
            Place in memory -> (index of the piece that stores the value there, the value).
        own : str
            Pointer to the memory, available in all pieces.
        room : int
            First free place in the memory, for values that later pieces read.
        """
        return _Cut(self.lines, self._starts, own, room).made(results)


class _Cut:
    def __init__(self, lines: Sequence[str], starts: Sequence[int], own: str, room: int) -> None:
        self.own, self.room = own, room
        ends = [*starts[1:], len(lines)]
        self.bodies = [list(lines[start:end]) for start, end in zip(starts, ends, strict=True)]
        self.texts: dict[str, str] = {}
        self.piece: dict[str, int] = {}
        for number, body in enumerate(self.bodies):
            for line in body:
                if found := _DEFINED.match(line):
                    self.texts[found[1]], self.piece[found[1]] = found[2], number
        self.kept: dict[str, int] = {}
        """Value -> its place in memory."""
        self._costs: dict[str, int] = {}

    def made(self, results: Mapping[int, tuple[int, Value]]) -> Pieces:
        stores: list[list[tuple[int, str]]] = [[] for _ in self.bodies]
        for place, (number, value) in results.items():
            if value in self.piece and value not in self.kept:
                self.kept[value] = place
            else:
                stores[number].append((place, value or ZERO))
        read = [self._earlier(number) for number in range(len(self.bodies))]
        for names in read:
            for name in names:
                self._keep_for(name)
        lines = []
        for number, (body, names) in enumerate(zip(self.bodies, read, strict=True)):
            w = _Again(self)
            for name in names:
                w.make(name)
            for _, value in stores[number]:
                if self.piece.get(value, number) < number:
                    w.make(value)
            new = [place for place in self.kept.items() if self.piece[place[0]] == number]
            ends = [*((value, place) for place, value in stores[number]), *new]
            lines.append([*w.lines, *body, *(line for end in ends for line in self.stored(*end))])
        return Pieces(lines, self.room)

    def _earlier(self, number: int) -> list[str]:
        """Values of earlier pieces that a piece reads."""
        found: dict[str, None] = {}
        for line in self.bodies[number]:
            names = _NAME.findall(line)
            found.update((name, None) for name in names if self.piece.get(name, number) < number)
        return list(found)

    def _keep_for(self, name: str) -> int:
        """Number of operations to compute a value again; 0 if it would exceed CHEAP and the value is stored."""
        if name in self.kept:
            return 0
        if name not in self._costs:
            text = self.texts[name]
            cost = 0 if _FREE.match(text) else 1 if _SHORT.match(text) else CHEAP + 1
            if cost <= CHEAP:
                cost += sum(self._keep_for(each) for each in _NAME.findall(text))
            if cost > CHEAP:
                self.kept[name] = self.room
                self.room += int(_type(text)[1]) if _type(text) != "double" else 1
                cost = 0
            self._costs[name] = cost
        return self._costs[name]

    def stored(self, value: str, place: int) -> list[str]:
        """Code that stores a value in memory."""
        at, kind = f"%to{place}", _type(self.texts.get(value, "double"))
        return [
            f"  {at} = getelementptr double, ptr {self.own}, i64 {place}",
            f"  store {kind} {value}, ptr {at}, align 8",
        ]


class _Again:
    """Code that loads or recomputes values of earlier pieces."""

    def __init__(self, cut: _Cut) -> None:
        self.cut = cut
        self.lines: list[str] = []
        self._known: set[str] = set()

    def make(self, name: str) -> None:
        if name in self._known or name not in self.cut.texts:
            return
        self._known.add(name)
        text = self.cut.texts[name]
        if name in self.cut.kept:
            place = self.cut.kept[name]
            self.lines.append(f"  %from{place} = getelementptr double, ptr {self.cut.own}, i64 {place}")
            text = f"load {_type(text)}, ptr %from{place}, align 8"
        else:
            for each in _NAME.findall(text):
                self.make(each)
        self.lines.append(f"  {name} = {text}")


def _type(text: str) -> str:
    """Result type of an instruction: double or a vector of doubles."""
    found = _VECTOR.search(text)
    if found is None or text.startswith("extractelement"):
        return "double"
    return found[0]
