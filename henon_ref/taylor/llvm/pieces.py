"""Straight-line code cut into pieces, one per order, which store the values that later pieces read."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from henon_ref.jit.ir_writer import ZERO, Value

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


def in_pieces(
    lines: Sequence[str], starts: Sequence[int], results: Mapping[int, tuple[int, Value]], own: str, room: int
) -> Pieces:
    """Cut straight-line code into pieces that can be compiled separately.

    Parameters
    ----------
    lines : sequence of str
    starts : sequence of int
        Index of the first line of each piece.
    results : mapping
        Place in memory -> (index of the piece that stores the value there, the value).
    own : str
        Pointer to the memory, available in all pieces.
    room : int
        First free place in the memory, for values that later pieces read.
    """
    return _Cut(lines, starts, own, room).made(results)


class _Cut:
    def __init__(self, lines: Sequence[str], starts: Sequence[int], own: str, room: int) -> None:
        self.own, self.room = own, room
        self.bodies = [lines[start:end] for start, end in pairwise([*starts, len(lines)])]
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
        stores: list[list[tuple[str, int]]] = [[] for _ in self.bodies]
        for place, (number, value) in results.items():
            if value in self.piece and value not in self.kept:
                self.kept[value] = place
            else:
                stores[number].append((value or ZERO, place))
        read = [self._earlier(number) for number in range(len(self.bodies))]
        for names in read:
            for name in names:
                self._keep_for(name)
        lines = []
        for number, (body, names) in enumerate(zip(self.bodies, read, strict=True)):
            before: dict[str, str] = {}
            for name in (*names, *(value for value, _ in stores[number])):
                if self.piece.get(name, number) < number:
                    self._again(name, before)
            new = [found for found in self.kept.items() if self.piece[found[0]] == number]
            ends = [line for found in (*stores[number], *new) for line in self._stored(*found)]
            lines.append([*before.values(), *body, *ends])
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

    def _stored(self, value: str, place: int) -> list[str]:
        """Code that stores a value in memory."""
        at, kind = f"%to{place}", _type(self.texts.get(value, "double"))
        return [
            f"  {at} = getelementptr double, ptr {self.own}, i64 {place}",
            f"  store {kind} {value}, ptr {at}, align 8",
        ]

    def _again(self, name: str, lines: dict[str, str]) -> None:
        """Add the code that loads or recomputes a value of an earlier piece; ``lines``: the code of each value."""
        if name in lines or name not in self.texts:
            return
        text, load = self.texts[name], ""
        if name in self.kept:
            place = self.kept[name]
            load = f"  %from{place} = getelementptr double, ptr {self.own}, i64 {place}\n"
            text = f"load {_type(text)}, ptr %from{place}, align 8"
        else:
            for each in _NAME.findall(text):
                self._again(each, lines)
        lines[name] = f"{load}  {name} = {text}"


def _type(text: str) -> str:
    """Result type of an instruction: double or a vector of doubles."""
    found = _VECTOR.search(text)
    if found is None or text.startswith("extractelement"):
        return "double"
    return found[0]
