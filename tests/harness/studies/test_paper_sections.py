"""Every claim of the paper's page that can be checked is checked, and none fails."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import sympy as sp

from henon_ref.casefile.case import load_case
from henon_ref.harness.report.manifest import Provenance, provenance
from henon_ref.harness.studies.paper import fig8, section2, section3, section4
from henon_ref.harness.studies.paper.claims import Claim, Section, checked, picture
from henon_ref.harness.studies.paper.exact import same, same_set
from henon_ref.harness.studies.paper.page import write_sections
from henon_ref.harness.studies.paper.systems import fig8_equations, fig8_listing_limit

CASES = Path(__file__).parents[3] / "cases"


def failures(claims):
    return [claim.where for claim in claims if claim.verdict == "fails"]


def verdicts(claims):
    return {claim.where: claim.verdict for claim in claims}


@pytest.mark.parametrize(("reading", "own"), [("equations", fig8_equations), ("listing_limit", fig8_listing_limit)])
def test_the_papers_systems_are_those_of_the_case_file(reading, own):
    case = {r.name: r.problem for r in load_case(CASES / "fig8.yaml").readings}[reading]
    problem = own()
    assert [sp.N(a - b, 30) for a, b in zip(case.initial, problem.initial, strict=True)] == [0, 0]
    for mode in ((-1,), (0,), (1,)):
        pair = [s.system.equations(mode) for s in (case, problem)]
        guards = [[g.expression for g in e.guards] for e in pair]
        for a, b in zip((*pair[0].field, *guards[0]), (*pair[1].field, *guards[1]), strict=True):
            difference = case.system.numeric(a) - problem.system.numeric(b)
            assert sp.simplify(difference) == 0


def test_section_2_holds():
    claims = section2.section().claims
    assert failures(claims) == []
    assert verdicts(claims)["Eq. (13)"] == "reproduced"
    assert verdicts(claims)["Eq. (1)"] == "corrected"


@pytest.mark.slow  # daily: .ci/run makes the page
def test_section_3_holds_and_sticks_do_occur_in_fig_4():
    made = section3.fan()
    assert 0 < made.sticking() < len(made.curves)
    assert made.one_orbit()
    assert made.orbit()[0] == pytest.approx(7.7229, abs=1e-4)
    assert failures(section3.fan_claims(made)) == []


@pytest.mark.slow  # daily: .ci/run makes the page
def test_section_4_holds(tmp_path):
    section = section4.section(tmp_path)
    assert failures(section.claims) == []
    assert verdicts(section.claims)["Eq. (17)"] == "corrected"
    assert {path.name for path in tmp_path.iterdir()} == {"fig6.svg", "fig7.svg"}


@pytest.mark.slow  # daily: .ci/run makes the page
def test_fig_8_holds_in_all_readings(tmp_path):
    section = fig8.section(tmp_path)
    assert failures(section.claims) == []
    assert "1.17460 and 0.41610" in section.claims[0].how
    assert "1.1743004676" in section.claims[0].how
    assert "0.3500047649 and 0.9327451920" in section.claims[0].how


def test_a_check_that_does_not_hold_is_said_to_fail():
    assert checked("Eq. (0)", "1 = 2", 1 == 2, "").verdict == "fails"
    assert checked("Eq. (0)", "1 = 1", 1 == 1, "", corrected=True).verdict == "corrected"


def test_a_figure_that_is_not_there_is_not_linked(tmp_path):
    with pytest.raises(FileNotFoundError, match="not been drawn"):
        picture(tmp_path, "fig9.svg", "none")


def test_expressions_are_compared_as_mathematics():
    c = sp.pi / 9
    assert same(sp.cos(c) * sp.cos(2 * c) * sp.cos(4 * c), sp.Rational(1, 8))
    assert not same(sp.cos(c), sp.cos(2 * c))
    assert not same_set([sp.Integer(1), sp.Integer(2)], [sp.Integer(1), sp.Integer(3)])


def page_text(sections: list[Section], origin: Provenance, folder: Path) -> str:
    return write_sections(sections, origin, folder).read_text(encoding="utf-8")


def test_the_page_counts_and_lists_every_claim(tmp_path):
    claims = (Claim("Eq. (1)", "a | b", "reproduced", "yes"), Claim("Eq. (2)", "c", "fails", "no"))
    text = page_text([Section("One", "text\n", claims)], provenance("python -m this"), tmp_path)
    assert "1 reproduced, 1 fails" in text
    assert "| Eq. (1) | a \\| b | **reproduced** | yes |" in text
    assert "## One" in text


def test_the_page_says_what_made_it_and_where(tmp_path):
    origin = replace(provenance("python -m this"), commit="0123456789abcdef")
    text = page_text([], origin, tmp_path)
    assert "Made by\n\n    python -m this\n\non " in text
    assert f"on {origin.machine_text}, from commit 0123456789ab." in text
    assert "[audit.csv](audit.csv)" in text
    assert f"on {origin.machine_text}. " in page_text([], replace(origin, commit=""), tmp_path)
