"""Tables of text, set as markdown, as plain columns for a terminal, and as HTML for a notebook."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from henon_ref.text import html, message


@dataclass(frozen=True)
class Table:
    """Headings, alignment (``l`` or ``r``) and rows of text."""

    headings: tuple[str, ...]
    alignment: str
    rows: Sequence[tuple[str, ...]]

    @property
    def markdown(self) -> str:
        """As a markdown table; its cells are markdown."""
        marks = {"l": "---", "r": "---:"}
        lines = [self.headings, tuple(marks[side] for side in self.alignment), *self.rows]
        return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)

    @property
    def text(self) -> str:
        """As lines of plain columns; its cells are text, without control characters when shown.

        Examples
        --------
        >>> print(Table(("solver", "digits"), "lr", [("henon", "15.9"), ("ida", "8")]).text)
        solver  digits
        henon     15.9
        ida          8
        """
        lines = [self.headings, *(tuple(map(message, row)) for row in self.rows)]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        sides = [str.rjust if side == "r" else str.ljust for side in self.alignment]
        return "\n".join(
            "  ".join(side(cell, width) for side, cell, width in zip(sides, line, widths, strict=True)).rstrip()
            for line in lines
        )

    @property
    def html(self) -> str:
        """As an HTML table; its cells are text, nothing in them is a tag or a formula."""
        head = "".join(f"<th>{html(cell)}</th>" for cell in self.headings)
        body = "".join(f"<tr>{''.join(f'<td>{html(cell)}</td>' for cell in row)}</tr>" for row in self.rows)
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
