"""Section 5: every claim holds; the rig and the belt of the page are those of the case files."""

from __future__ import annotations

from pathlib import Path

import pytest

from henon_ref.casefile.case import load_case
from henon_ref.harness.studies.paper import belt, section5
from henon_ref.harness.studies.paper.rig import rig_problem

CASES = Path(__file__).parents[3] / "cases"


@pytest.mark.slow  # daily: .ci/run makes the paper's page, which fails where a claim does
def test_every_claim_of_section_5_holds(tmp_path: Path) -> None:
    found = section5.section(tmp_path)
    assert [claim.where for claim in found.claims if claim.verdict == "fails"] == []
    assert {path.name for path in tmp_path.iterdir()} == {"section5_motions.svg", "section5_estimate.svg"}
    assert {"Eq. (27)", "Eq. (28)", "Eqs. (25), (26)", "Fig. 9", "Fig. 10", "Fig. 11", "Fig. 12", "Sec. 6"} <= {
        claim.where for claim in found.claims
    }


@pytest.mark.parametrize(("case", "speed"), [("rig_periodic", "0.40"), ("rig_chaotic", "0.03")])
def test_the_rig_is_that_of_the_case_file(case: str, speed: str) -> None:
    theirs = load_case(CASES / f"{case}.yaml").readings[0].problem
    ours = rig_problem(speed)
    for mode in ((-1,), (0,), (1,)):
        pairs = [s.system.equations(mode).field for s in (theirs, ours)]
        for a, b in zip(*pairs, strict=True):
            assert (theirs.system.numeric(a) - ours.system.numeric(b)).simplify() == 0


def test_the_belt_is_that_of_the_case_file_and_settles_on_its_orbit() -> None:
    case = load_case(CASES / "moving_belt.yaml").readings[0]
    ours = belt.belt_problem()
    for mode in ((-1,), (0,), (1,)):
        pairs = [s.system.equations(mode).field for s in (case.problem, ours)]
        for a, b in zip(*pairs, strict=True):
            assert (case.problem.system.numeric(a) - ours.system.numeric(b)).simplify() == 0
    assert belt.moving_belt().sticks == pytest.approx((5.744957024861, 13.075740440551), abs=1e-9)
