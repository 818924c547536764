"""The table of ``docs/which_solver.md``, from the matrix of the committed reports.

Run ``python docs/which_solver.py`` after reports have been made.
"""

from __future__ import annotations

from pathlib import Path

from website.solver_choice import at_a_glance

PAGE = Path(__file__).with_suffix(".md")
MARK = "<!-- Made by `python docs/which_solver.py` from reports/matrix.csv. -->\n\n"


def page() -> str:
    """The page with its table made anew."""
    before, mark, rest = PAGE.read_text(encoding="utf-8").partition(MARK)
    return before + mark + at_a_glance() + "\n\n" + rest.partition("\n\n")[2]


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
