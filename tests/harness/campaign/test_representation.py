"""Representation of a comparison and a case in ``print`` and a notebook; names in them are untrusted text."""

from __future__ import annotations

import json
from dataclasses import replace
from html.parser import HTMLParser

import pytest
from fakes import case, expected, found, trajectory, truth

from henon_ref.casefile.case import Case, parse_case
from henon_ref.errors import CaseError
from henon_ref.harness.campaign.comparison import Comparison, ReadingResult
from henon_ref.harness.campaign.options import Options, Setting
from henon_ref.harness.campaign.rows import Outcome, record
from henon_ref.harness.score.scoring import score
from henon_ref.workers.worker import Failure

EVIL = "<script>alert(1)</script><img src=x> $x$ \\(y\\) \x1b[31mred \u202eback"


class Read(HTMLParser):
    """The tags of a page, and its text."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.pieces: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)

    def handle_data(self, data):
        self.pieces.append(data)


def run(solver: str, rtol: float, error: float, wall: float, failure: Failure | None = None, lost: int = 0):
    reading, setting = case().readings[0], Setting(rtol, rtol)
    if failure is not None:
        return record(Outcome("made_up", reading, solver, setting, failure=failure), expected())
    ran = trajectory(found(error=error)[lost:])
    known = {"trajectory": ran, "score": score(ran, expected(), tolerance=rtol), "samples": (wall,)}
    return record(Outcome("made_up", reading, solver, setting, **known), expected())


def comparison(*records, of: Case | None = None) -> Comparison:
    of = of or case()
    return Comparison(of, [ReadingResult(of.readings[0], truth())], list(records), Options())


def made() -> Comparison:
    return comparison(
        run("slow", 1e-3, 1e-3, 1.0), run("slow", 1e-6, 1e-6, 2.0), run("fast", 1e-6, 1e-8, 0.002),
        run("loses", 1e-6, 1e-8, 0.001, lost=1), run("none", 1e-6, 0, 0, Failure("unavailable", "not installed")),
    )  # fmt: skip


def test_a_comparison_is_a_table_of_some_lines():
    text = str(made())
    assert text == repr(made())
    assert text.splitlines()[:4] == [
        "Comparison of made_up: 1 reading, 5 runs, 3 of them right",
        "solver  right of judged  digits  time  times as long  note",
        "fast             1 of 1     7.9  2 ms              1",
        "slow             1 of 1       6   2 s           1000",
    ]
    assert len(text.splitlines()) == 6
    assert "0 of 1" in text.splitlines()[4]
    assert text.splitlines()[4].startswith("loses")
    assert text.splitlines()[5].startswith("none         not judged")
    assert text.splitlines()[5].endswith("unavailable: not installed")
    assert repr(comparison()) == "Comparison of made_up: 1 reading, 0 runs, 0 of them right"


def test_the_table_is_of_the_tightest_setting():
    text = repr(comparison(run("one", 1e-3, 1e-3, 9.0), run("one", 1e-6, 1e-6, 4.0)))
    assert text.splitlines()[2].split() == ["one", "1", "of", "1", "6", "4", "s", "1"]


def test_what_a_terminal_is_shown_is_printable_lines():
    text = str(comparison(run(EVIL, 1e-6, 1e-8, 1.0), run("gone", 1e-6, 0, 0, Failure("failed", EVIL * 9))))
    assert all(line.isprintable() for line in text.split("\n"))
    assert len(text.split("\n")) == 4


HOSTILE = """
schema: 1
name: c
title: {title}
system: {{state: [x_1], surfaces: {{s: x_1}}, field: [-s]}}
initial: {{t: 0, x_1: 1}}
until: 2
readings: {{one: {{}}, two: {{system: {{field: [-2*s]}}}}}}
"""


def hostile() -> Case:
    return parse_case(HOSTILE.format(title=json.dumps(EVIL.replace("\x1b", ""))))


@pytest.mark.parametrize(
    "shown",
    [hostile(), comparison(run(EVIL, 1e-6, 1e-8, 1.0), run("x", 1e-6, 0, 0, Failure("failed", EVIL)), of=hostile())],
    ids=["case", "comparison"],
)
def test_a_notebook_makes_no_tag_and_no_formula_of_a_stranger_s_text(shown):
    page = shown._repr_html_()
    read = Read(page)
    assert set(read.tags) <= {"p", "b", "table", "thead", "tbody", "tr", "th", "td", "div", "span"}
    assert "<script>alert(1)</script>" in "".join(read.pieces)  # as text
    formulas = [piece for piece in read.pieces if piece.startswith("$$")]
    assert formulas
    for piece in set(read.pieces) - set(formulas):
        assert piece in ("$", "\\") or not set(piece) & set("$\\")
    for formula in formulas:
        assert formula.startswith("$$\\begin{aligned}\n\\dot{x_{1}} &= ")
        assert formula.endswith("\\end{aligned}$$")


def test_a_case_shows_its_readings_and_each_system_once():
    read = Read(hostile()._repr_html_())
    assert {"one", "one:"} <= set(read.pieces)  # in the table, and at its equations
    assert sum(piece.startswith("$$") for piece in read.pieces) == 2
    same = Read(case()._repr_html_())
    assert sum(piece.startswith("$$") for piece in same.pieces) == 1
    assert repr(case()) == "Case made_up: A made-up system\nreadings: default\nstates: x; surfaces: s"


def test_the_plot_is_axes_that_pyplot_shows():
    from matplotlib import pyplot as plt

    plt.close("all")
    axes = made().plot()
    assert plt.get_fignums() == [axes.figure.number]
    assert plt.gca() is axes
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert axes.get_title(loc="left") == "Accuracy against time"
    drawn = sorted(x for line in axes.lines for x in line.get_xdata())
    assert {0.001, 0.002, 1.0, 2.0} <= set(drawn)
    plt.close("all")
    with pytest.raises(CaseError, match="fewer than two timed runs"):
        comparison(run("one", 1e-6, 1e-6, 1.0)).plot()
    with pytest.raises(CaseError, match="no reading 'defualt'; did you mean 'default'"):
        made().plot("defualt")


def test_the_plot_of_one_of_several_readings_names_it():
    from matplotlib import pyplot as plt

    several = made()
    other = replace(several.readings[0].reading, name="other")
    several.readings.append(ReadingResult(other, several.readings[0].truth))
    assert several.plot().get_title(loc="left") == "Accuracy against time: default"
    plt.close("all")
