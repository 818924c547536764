"""Claims of the paper's page hold; .ci/slow makes the page, with all sections, which fails where one does not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import sympy as sp
from made_reports import study_request

from henon_ref.casefile.case import load_case
from henon_ref.harness.report.manifest import provenance
from henon_ref.harness.studies.paper import page, section3, section5, systems
from henon_ref.harness.studies.paper.systems import Findings, same, same_set
from henon_ref.modes.switched_field import Release, SlidingOverride
from henon_ref.modes.system import FilippovSystem

CASES = Path(__file__).parents[3] / "cases"
SECTIONS = {section["of"]: section for section in page.read_sections()}


def checked(of: str) -> dict[str, dict[str, str]]:
    """The claims of a section by place, the first of each; none fails, and its figures stand in its text."""
    found = page.SECTIONS[of]()
    claims = list(page.claims_of(SECTIONS[of], found))
    assert [claim["where"] for claim in claims if claim["verdict"] == "fails"] == []
    text = page.text_of(SECTIONS[of], found)
    assert set(SECTIONS[of].get("captions", {})) == set(found.figures)
    assert all(f"]({name}.svg)" in text for name in found.figures)
    return {claim["where"]: claim for claim in reversed(claims)}


def listing_limit() -> FilippovSystem:
    """The paper's system with slip 3 f, and a stick that ends at the upper tangent point."""
    system = systems.section_4(systems.FIG8_VALUES)
    release = Release(systems.X1 - systems.BASE - systems.INNER, "rising", -1)
    override = SlidingOverride((systems.VP, sp.Integer(0)), (release,))
    return replace(system, field=tuple(3 * f for f in system.field), overrides={0: override})


@pytest.mark.parametrize(
    ("reading", "own"),
    [("equations", systems.section_4(systems.FIG8_VALUES)), ("listing_limit", listing_limit())],
    ids=["equations", "listing_limit"],
)
def test_the_papers_systems_are_those_of_the_case_file(reading: str, own: FilippovSystem) -> None:
    case = load_case(CASES / "fig8.yaml").reading(reading).problem
    start = (-systems.INNER, systems.FIG8_VALUES[systems.VP])
    assert [sp.N(a - b, 30) for a, b in zip(case.initial, start, strict=True)] == [0, 0]
    for mode in ((-1,), (0,), (1,)):
        theirs, ours = (
            (*e.field, *(g.expression for g in e.guards)) for e in (case.system.equations(mode), own.equations(mode))
        )
        for a, b in zip(theirs, ours, strict=True):
            assert sp.simplify(case.system.numeric(a) - own.numeric(b)) == 0


def test_section_2_holds() -> None:
    claims = checked("section_2")
    assert claims["Eq. (13)"]["verdict"] == "reproduced"
    assert claims["Eq. (1)"]["verdict"] == "corrected"


def test_section_4_holds() -> None:
    claims = checked("section_4")
    assert claims["Eq. (23)"]["verdict"] == "reproduced"


@pytest.mark.slow  # daily: section 2, by the same analysis, and Fig. 8
def test_section_3_holds_and_sticks_do_occur_in_fig_4() -> None:
    found = section3.fan_findings()
    assert all(found.holds.values())
    assert 0 < found.values["sticking"] < found.values["count"]
    assert found.values["period"] == pytest.approx(7.7229, abs=1e-4)


def test_fig_8_holds_in_all_readings() -> None:
    how = checked("fig_8")["Fig. 8, Sec. 4.2"]["how"]
    assert "1.17460 and 0.41610" in how
    assert "1.1743004676" in how
    assert "0.3500047649 and 0.9327451920" in how


def test_the_moving_belt_settles_on_its_orbit() -> None:
    found = section5.moving_belt()
    assert found.holds == {"moving_belt": True}
    assert found.values["settled"] == pytest.approx((5.744957024861, 13.075740440551), abs=1e-9)


def test_expressions_are_compared_as_mathematics() -> None:
    c = sp.pi / 9
    assert same(sp.cos(c) * sp.cos(2 * c) * sp.cos(4 * c), sp.Rational(1, 8))
    assert not same(sp.cos(c), sp.cos(2 * c))
    assert not same_set([sp.Integer(1), sp.Integer(2)], [sp.Integer(1), sp.Integer(3)])


def claim(**own: str) -> dict[str, Any]:
    return {"where": "Eq. (0)", "says": "1 = 1", "how": "so", **own}


def test_a_check_that_does_not_hold_is_said_to_fail() -> None:
    section = {"claims": [claim(), claim(check="a"), claim(check="b", verdict="corrected", how="{x:.1f}")]}
    holding, failing = (Findings({"a": True, "b": b}, {"x": 1.25}) for b in (True, False))
    assert [own["verdict"] for own in page.claims_of(section, holding)] == ["reproduced", "reproduced", "corrected"]
    *_, last = page.claims_of(section, failing)
    assert (last["verdict"], last["how"]) == ("fails", "1.2")


def test_what_is_not_computed_is_not_claimed() -> None:
    """Neither a check, nor a value, nor a figure."""
    for own in ({"check": "a"}, {"how": "{x}"}):
        with pytest.raises(KeyError):
            list(page.claims_of({"claims": [claim(**own)]}, Findings({})))
    with pytest.raises(KeyError, match="fig9"):
        page.text_of({"text": "{fig9}", "captions": {"fig9": "none"}}, Findings({}))


def test_the_page_counts_and_lists_every_claim_and_says_what_made_it(tmp_path: Path, monkeypatch) -> None:
    claims = [claim(says="a | b", how="yes"), claim(where="Eq. (2)", check="a", how="no")]
    section = {"title": "One", "of": "one", "text": "a text\n", "claims": claims}
    monkeypatch.setattr(page, "read_sections", lambda: [section])
    monkeypatch.setattr(page, "SECTIONS", {"one": lambda: Findings({"a": False}, files={"audit.csv": "a\n"})})
    origin = replace(provenance("python -m this"), commit="0123456789abcdef")
    made = page.run_paper(study_request([], None, tmp_path, origin=origin))
    assert (made.holds, made.remarks) == (False, ["fails: Eq. (2): 1 = 1"])
    text = made.page.read_text(encoding="utf-8")
    assert "1 reproduced, 1 fails" in text
    assert "| Eq. (0) | a \\| b | **reproduced** | yes |" in text
    assert "## One\n\na text\n" in text
    assert "Made by\n\n    python -m this\n\non " in text
    assert f"on {origin.machine_text}, from commit 0123456789ab." in text
    assert "[audit.csv](audit.csv)" in text
    assert (tmp_path / "audit.csv").read_text() == "a\n"
