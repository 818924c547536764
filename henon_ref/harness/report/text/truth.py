"""What the runs of a reading are scored against: where it comes from, and what is proven of it."""

from __future__ import annotations

from collections.abc import Iterable

from henon_ref.harness.campaign.results import ReadingResult
from henon_ref.harness.report.text.formats import exponential, listing, significant
from henon_ref.harness.rows import RunRow
from henon_ref.harness.score.reference import Expected
from henon_ref.harness.table import Table
from henon_ref.text import markdown

HEADINGS = ("truth", "value", "note")
DEPENDENT = ("henon", "heyoka")
"""How names of solvers begin that share the library of a truth, or the rule that selects its modes."""


def truth_table(result: ReadingResult, runs: Iterable[RunRow] = ()) -> Table:
    """The exact run: its end, its transitions, what is proven of them, how they were computed.

    Where no enclosure certifies them, ``runs`` of other libraries say whether something else confirms their modes.
    """
    statement, expected = result.statement, result.expected
    if expected is None:
        return Table(HEADINGS, "lll", [("exact run", "none, nothing is scored", _reason(result))])
    touches = sum(event.kind == "graze" for event in expected.transitions)
    rows = [
        ("exact run", _end(expected), _note("the truth ends there" if expected.partial else "", _reason(result))),
        ("transitions", f"{len(expected.transitions) - touches}", ""),
        ("touches", f"{touches}", "a surface is met and not crossed" if touches else ""),
        ("certified", *_certified(result, expected)),
    ]
    if not statement.certified and expected.transitions:
        names = sorted({f"`{run.solver}`" for run in runs if _confirms(run)})
        note = "its driver finds the same transitions" if len(names) == 1 else "their drivers find the same transitions"
        rows.append(("modes confirmed by", *((listing(names), note) if names else ("nothing independent", ""))))
    if expected.radius:
        radius = f"{exponential(expected.radius, 1)} s"
        rows.append(("largest radius of a transition time", radius, "no error is claimed below it"))
    if statement.closed_forms:
        rows.append(("closed forms of the case", f"{statement.closed_forms}", "transition times that agree with them"))
    for method, bits, seconds in statement.methods:
        note = f"{listing([f'{b}' for b in bits])} bits, {significant(seconds, 2)} s" if bits else ""
        rows.append(("computed by", method, note))
    if statement.near_grazes:
        rows.append(("near touches", f"{statement.near_grazes}", "instants at which a surface is nearly met"))
    return Table(HEADINGS, "lll", rows)


def _confirms(run: RunRow) -> bool:
    """Whether a run of an independent library has all transitions of the truth, each with its modes, and no other."""
    return run.status == "ok" and not run.missed and not run.spurious and not run.solver.startswith(DEPENDENT)


def no_truth(result: ReadingResult) -> str:
    """A sentence where no run is judged, for want of a truth; else nothing."""
    if result.expected is not None and not result.expected.nothing_known:
        return ""
    reason = _reason(result)
    return "No run is judged: there is no truth" + (f" ({reason})." if reason else ".")


def _reason(result: ReadingResult) -> str:
    return markdown(result.statement.reason).rstrip(".")


def _end(expected: Expected) -> str:
    if expected.nothing_known:
        return "unknown after its start, no run is judged"
    return f"{expected.status}, to t = {significant(expected.end_time, 9)} s"


def _certified(result: ReadingResult, expected: Expected) -> tuple[str, str]:
    """Whether the truth is proven, and what that means or why it is not."""
    statement, number = result.statement, len(expected.transitions)
    if statement.certified and not number:
        return "yes", "it is proven in ball arithmetic that there is no transition"
    if statement.certified:
        each = "the only transition" if number == 1 else f"every one of the {number}"
        return "yes", f"{each} is enclosed in ball arithmetic, and it is proven that there is no other"
    why = markdown(statement.uncertified_because).rstrip(".")
    return (f"{statement.proven} of {number}" if statement.proven else "no"), why


def _note(*parts: str) -> str:
    return "; ".join(part for part in parts if part)
