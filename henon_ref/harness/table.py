"""Tables of text as markdown, as plain columns for a terminal and as HTML for a notebook; formats of numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from henon_ref.text import html, message


@dataclass(frozen=True)
class Table:
    """Headings, alignment (``l`` or ``r``; the last letter is also for all further columns) and rows of text."""

    headings: tuple[str, ...]
    alignment: str
    rows: Sequence[tuple[str, ...]]

    @property
    def _sides(self) -> str:
        return self.alignment.ljust(len(self.headings), self.alignment[-1])

    @property
    def markdown(self) -> str:
        """Markdown table; the cells are markdown."""
        marks = {"l": "---", "r": "---:"}
        lines = [self.headings, tuple(marks[side] for side in self._sides), *self.rows]
        return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)

    @property
    def text(self) -> str:
        """Lines of plain columns; the cells are text, shown without control characters.

        >>> print(Table(("solver", "digits"), "lr", [("henon", "15.9"), ("ida", "8")]).text)
        solver  digits
        henon     15.9
        ida          8
        """
        lines = [self.headings, *(tuple(map(message, row)) for row in self.rows)]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        sides = [str.rjust if side == "r" else str.ljust for side in self._sides]
        return "\n".join(
            "  ".join(side(cell, width) for side, cell, width in zip(sides, line, widths, strict=True)).rstrip()
            for line in lines
        )

    @property
    def html(self) -> str:
        """HTML table; the cells are text, in which tags and formulas are escaped."""
        head = "".join(f"<th>{html(cell)}</th>" for cell in self.headings)
        body = "".join(f"<tr>{''.join(f'<td>{html(cell)}</td>' for cell in row)}</tr>" for row in self.rows)
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def duration(seconds: object) -> str:
    """Format a wall time with three digits and a unit.

    >>> duration(3.456e-4), duration(0.0123), duration(12.0), duration(None)
    ('0.346 ms', '12.3 ms', '12 s', '')
    """
    if not isinstance(seconds, float | int) or math.isnan(seconds):
        return ""
    if seconds < 1e-4:
        return f"{significant(seconds * 1e6)} µs"
    if seconds < 1.0:
        return f"{significant(seconds * 1e3)} ms"
    return f"{significant(seconds)} s"


def significant(value: float, places: int = 3) -> str:
    """Round a number to significant places, without an exponent if it is neither large nor small.

    >>> significant(0.34567), significant(1234.5), significant(12.0), significant(0.000001234)
    ('0.346', '1230', '12', '1.23e-6')
    """
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    exponent = math.floor(math.log10(abs(value)))
    if -3 <= exponent < 6:
        behind = places - 1 - exponent
        text = f"{round(value, behind):.{max(behind, 0)}f}"
        return text.rstrip("0").rstrip(".") if behind > 0 else text
    return exponential(value, places)


def exponential(value: float, places: int = 2) -> str:
    """Format a number in scientific notation, without leading zeros in the exponent.

    >>> exponential(1.234e-13), exponential(-5e-5), exponential(1e-6, 1)
    ('1.2e-13', '-5.0e-5', '1e-6')
    """
    mantissa, _, power = f"{value:.{places - 1}e}".partition("e")
    return f"{mantissa}e{int(power)}"


def error(value: object, floor: float = 0.0) -> str:
    """Format a time error [s]; an error below ``floor`` is shown as a bound.

    >>> error(3.21e-13), error(1e-40, 1e-30), error(0.0), error(None)
    ('3.2e-13', '< 1e-30', '0', '')
    """
    if not isinstance(value, float | int) or math.isnan(value):
        return ""
    if abs(value) < floor:
        return f"< {exponential(floor, 1)}"
    return "0" if value == 0 else exponential(float(value))


def digits(value: float | None) -> str:
    """Format a number of digits, rounded down.

    >>> digits(11.99996), digits(9.0), digits(-0.04), digits(None)
    ('11.9', '9', '-0.1', '')
    """
    return "" if value is None else f"{math.floor(value * 10 + 1e-9) / 10:g}"


def setting(rtol: object, step: object) -> str:
    """Format the tolerance or step of a run.

    >>> setting(1e-9, None), setting(None, 0.0001)
    ('1e-9', 'h = 0.0001 s')
    """
    if isinstance(rtol, float | int):
        return exponential(float(rtol), 1) if float(f"{rtol:.0e}") == rtol else f"{rtol:g}"
    return f"h = {step:g} s" if isinstance(step, float | int) else ""


def listing(items: Sequence[str]) -> str:
    """Join items to a phrase.

    >>> listing(["a"]), listing(["a", "b"]), listing(["a", "b", "c"])
    ('a', 'a and b', 'a, b and c')
    """
    return " and ".join(filter(None, [", ".join(items[:-1]), *items[-1:]]))


def count(number: int, noun: str) -> str:
    """Format a number with its noun.

    >>> count(1, "transition"), count(2, "transition"), count(0, "crossing")
    ('1 transition', '2 transitions', 'no crossings')
    """
    return f"{number or 'no'} {noun}" + ("" if number == 1 else "s")
