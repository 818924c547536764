"""LLVM IR for one number turned into IR for the lanes of vectors: the same operations, with the same bits.

A pointer ``%p0``, ``%p1``, ... stands for one place in each lane: neighbouring places, or the same place in all lanes.
Other arrays (``%N``) hold a vector at each place. The numbers ``%unit``, ``%t_hi`` and ``%t_lo`` become the vectors
``%unit.lanes``, ``%t_hi.lanes`` and ``%t_lo.lanes``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from henon_ref.jit.ir_writer import LANES, PAIR, VECTOR

_POINTED = re.compile(r"  (%\S+) = getelementptr double, ptr %(\w+), i64 \d+")
_LOADED = re.compile(r"  (%\S+) = load double, ptr (%[^,]+), align 8")
_STORED = re.compile(r"  store double (\S+), (.*)")
_CALLED = re.compile(r"  (%\S+) = call double @([\w.]+)\((.*)\)")
_SELECTED = re.compile(r"  (%\S+) = select i1 (%\S+), double (\S+), double (\S+)")
_COMPUTED = re.compile(r"  (%\S+ = (?:fadd|fsub|fmul|fdiv|fneg|fcmp \w+)) double (.*)")
_PAIR_CALLED = re.compile(rf"  (%\S+) = call {PAIR} @(\w+)\((.*)\)")
_PAIR_READ = re.compile(rf"  (%\S+) = extractvalue {PAIR} (%\S+), (\d)")
_ARGUMENTS = ("%unit", "%t_hi", "%t_lo")


def arrangement(places: Sequence[Sequence[int]]) -> tuple[str, ...]:
    """Where each pointer's numbers of the lanes are, ``in a row`` or ``same``; empty if some are neither.

    ``places``: for each lane the places of all pointers.
    """
    found = []
    for first, *others in zip(*places, strict=True):
        if others == [first + i for i in range(1, LANES)]:
            found.append("in a row")
        elif others == [first] * (LANES - 1):
            found.append("same")
        else:
            return ()
    return tuple(found)


def can_be_in_lanes(lines: Iterable[str]) -> bool:
    """Whether code neither branches nor reads the time."""
    return not any(re.search(r" br |%t_", line) for line in lines)


def in_lanes(lines: Iterable[str], arranged: Sequence[str] = ()) -> list[str]:
    """Write straight-line code for all lanes; ``arranged``: where the numbers of ``%p0``, ``%p1``, ... are."""
    found: list[str] = []
    same: set[str] = set()
    """Pointers to the same number in all lanes."""
    for line in lines:
        if pointed := _POINTED.fullmatch(line):
            name, array = pointed.groups()
            if array.startswith("p") and arranged[int(array[1:])] == "same":
                same.add(name)
            found.append(line)
        else:
            found += _widened(line, same)
    return found


def splat(name: str, value: str) -> list[str]:
    """Fill a vector with one number."""
    return [
        f"  {name}.one = insertelement {VECTOR} poison, double {value}, i64 0",
        f"  {name} = shufflevector {VECTOR} {name}.one, {VECTOR} poison, <{LANES} x i32> zeroinitializer",
    ]


def _widened(line: str, same: set[str]) -> list[str]:
    if found := _COMPUTED.fullmatch(line):
        return [f"  {found[1]} {VECTOR} {', '.join(map(_wide, found[2].split(', ')))}"]
    if found := _LOADED.fullmatch(line):
        name, pointer = found.groups()
        if pointer in same:
            return [f"  {name}.number = load double, ptr {pointer}, align 8", *splat(name, f"{name}.number")]
        return [f"  {name} = load {VECTOR}, ptr {pointer}, align 8"]
    if found := _STORED.fullmatch(line):
        return [f"  store {VECTOR} {_wide(found[1])}, {found[2]}"]
    if found := _SELECTED.fullmatch(line):
        values = ", ".join(f"{VECTOR} {_wide(value)}" for value in found.groups()[2:])
        return [f"  {found[1]} = select <{LANES} x i1> {found[2]}, {values}"]
    if found := _PAIR_CALLED.fullmatch(line):
        return _calls(found[1], PAIR, found[2], _arguments(found[3]))
    if found := _PAIR_READ.fullmatch(line):
        name, pair, which = found.groups()
        reads = [f"  {name}.of{i} = extractvalue {PAIR} {pair}.of{i}, {which}" for i in range(LANES)]
        return [*reads, *_joined(name)]
    found = _CALLED.fullmatch(line)
    assert found, line
    name, function, text = found.groups()
    if not function.startswith("llvm."):
        return [*_calls(name, "double", function, _arguments(text)), *_joined(name)]
    wide = ", ".join(f"{VECTOR} {each}" for each in _arguments(text))
    return [f"  {name} = call {VECTOR} @{function.replace('.f64', f'.v{LANES}f64')}({wide})"]


def _arguments(text: str) -> list[str]:
    return [_wide(each.removeprefix("double ")) for each in text.split(", ")]


def _wide(value: str) -> str:
    if value.startswith("0x"):
        return f"<{', '.join([f'double {value}'] * LANES)}>"
    return f"{value}.lanes" if value in _ARGUMENTS else value


def _calls(name: str, kind: str, function: str, arguments: Sequence[str]) -> list[str]:
    """Call a function for each lane: the results are ``name.of0``, ``name.of1``, ..."""
    lines = []
    for i in range(LANES):
        numbers = [f"{name}.from{i}.{j}" for j in range(len(arguments))]
        lines += [
            f"  {number} = extractelement {VECTOR} {argument}, i64 {i}"
            for number, argument in zip(numbers, arguments, strict=True)
        ]
        lines.append(f"  {name}.of{i} = call {kind} @{function}({', '.join(f'double {number}' for number in numbers)})")
    return lines


def _joined(name: str) -> list[str]:
    """Put ``name.of0``, ``name.of1``, ... into the lanes of a vector."""
    lines, before = [], "poison"
    for i in range(LANES):
        after = name if i == LANES - 1 else f"{name}.part{i}"
        lines.append(f"  {after} = insertelement {VECTOR} {before}, double {name}.of{i}, i64 {i}")
        before = after
    return lines
