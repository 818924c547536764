"""HTML of a case for a notebook: its readings in a table, its equations as formulas."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

from henon_ref.grouping import grouped
from henon_ref.modes.latex import general_form
from henon_ref.modes.problem import Problem
from henon_ref.text import html, listed


def case_html(name: str, title: str, problems: Mapping[str, Problem]) -> str:
    """Return a table of the readings' problems, followed by the equations; text of the case is escaped."""
    rows = [_row(reading, problem) for reading, problem in list(problems.items())[:12]]
    head = "".join(f"<th>{word}</th>" for word in ("reading", "states", "surfaces", "from t [s]", "to t [s]"))
    body = "".join(f"<tr>{''.join(f'<td>{html(cell)}</td>' for cell in row)}</tr>" for row in rows)
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    more = f"<p>and {len(problems) - len(rows)} more readings</p>" if len(problems) > len(rows) else ""
    return f"<p><b>{html(name)}</b>: {html(title)}</p>{table}{more}{equations_html(problems)}"


def _row(reading: str, problem: Problem) -> tuple[str, ...]:
    states, signs = problem.system.state_names, problem.system.sign_names
    return reading, listed(states), listed(signs), f"{float(problem.start):g}", f"{float(problem.until):g}"


def equations_html(problems: Mapping[str, Problem]) -> str:
    """Return the equations of the readings as typeset formulas; equal systems are shown once."""
    systems = grouped(problems, lambda reading: general_form(problems[reading].system))
    shown = list(systems.items())[:3]
    parts = [
        (f"<p>{html(listed(readings, 6))}:</p>" if len(systems) > 1 else "")
        + (f"<div>$${escape(formula)}$$</div>" if formula else "<p>the equations are too long to be typeset</p>")
        for formula, readings in shown
    ]
    more = f"<p>and {len(systems) - len(shown)} more systems of equations</p>" if len(systems) > len(shown) else ""
    return "".join(parts) + more
