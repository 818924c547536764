"""A table on standard output: on a terminal set by rich, elsewhere plain columns."""

from __future__ import annotations

import sys
from collections.abc import Collection, Sequence

from henon_ref.cli.colours import console_colours
from henon_ref.text import message


def print_table(headings: Sequence[str], lines: Sequence[Sequence[str]], *, right: Collection[str] = ()) -> None:
    """Print a table; what is in its cells is text, neither markup nor control characters.

    Parameters
    ----------
    headings : sequence of str
    lines : sequence of sequence of str
        An entry a heading.
    right : collection of str
        Headings of the columns that are set to the right.
    """
    cells = [[message(cell) for cell in line] for line in lines]
    if sys.stdout.isatty():
        _print_on_terminal(headings, cells, right)
        return
    widths = [max(map(len, column)) for column in zip(headings, *cells, strict=True)]
    for line in [headings, *cells]:
        columns = zip(headings, line, widths, strict=True)
        print("  ".join(cell.rjust(w) if name in right else cell.ljust(w) for name, cell, w in columns).rstrip())


def _print_on_terminal(headings: Sequence[str], cells: Sequence[Sequence[str]], right: Collection[str]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    made = Table(box=box.SIMPLE_HEAD)
    for number, heading in enumerate(headings):
        made.add_column(heading, justify="right" if heading in right else "left", no_wrap=number == 0)
    for line in cells:
        made.add_row(*map(Text, line))
    Console(file=sys.stdout, **console_colours()).print(made)
