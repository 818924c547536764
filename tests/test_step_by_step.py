"""What the step-by-step pages show does what they say."""

from __future__ import annotations

from pathlib import Path

import pytest
from doc_pages import blocks

from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.casefile.case import parse_case
from henon_ref.errors import CaseError
from henon_ref.trajectory import Trajectory

DOCS = Path(__file__).parent.parent / "docs"


def first_case() -> str:
    page = (DOCS / "first_case.md").read_text(encoding="utf-8")
    (found,) = [block.code for block in blocks(page) if block.file == "pendulum.yaml"]
    return found


def sticks(run: Trajectory) -> list[float]:
    """Durations of the sticks that begin after the start."""
    began = {event.time for event in run.transitions if event.kind == "stick"}
    ended = [event.time for event in run.transitions if event.kind == "release"]
    return [min(end for end in ended if end > begin) - begin for begin in sorted(began)]


def test_the_first_case_has_the_transitions_that_its_page_tells() -> None:
    run = HENON_SOLVER.prepare(parse_case(first_case()).readings[0].problem, rtol=1e-12)()
    assert (run.status, len(run.transitions)) == ("ok", 7)
    assert run.transitions[0].kind == "release"
    assert [run.transitions[0].time, *sticks(run)] == pytest.approx([1.694703, 0.091082, 2.532622], abs=1e-6)


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("M*s", "M*sgn(w)"),
        ("cos(Omega*t)", "cos(Om*t)"),
        (", w: 0}", "}"),
        ("{s: w}", "[w]"),
        ("name: pendulum", "name: My pendulum"),
        ("schema: 1\n", ""),
    ],
)
def test_mistakes_get_the_messages_of_the_page(right: str, wrong: str) -> None:
    page = (DOCS / "first_case.md").read_text(encoding="utf-8")
    with pytest.raises(CaseError) as told:
        parse_case(first_case().replace(right, wrong), file="pendulum.yaml")
    assert str(told.value) in page
