"""The atlas: families of readings, outcomes of runs, and the page with its figure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from made_reports import study_request
from matplotlib.colors import to_rgba
from shipped import CASES, shipped

from henon_ref.casefile.case import load_case
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.result_files import read_rows
from henon_ref.harness.rows import RunRow
from henon_ref.harness.studies.atlas import OUTCOMES, TOLERANCES, draw_atlas, family_of, outcome_of, run_atlas


def row(**values: object) -> RunRow:
    names = {"case": "c", "reading": "default", "solver": "henon"}
    return RunRow(**names | {"status": "ok", "verdict": "right", "missed": 0, "spurious": 0} | values)


@pytest.mark.parametrize(
    ("values", "outcome"),
    [
        ({}, "right"),
        ({"verdict": "solver defect", "status": "wrong", "missed": 2}, "missed"),
        ({"verdict": "ill-conditioned", "status": "wrong", "spurious": 1}, "spurious"),
        ({"verdict": "solver defect", "status": "wrong", "missed": 1, "spurious": 1}, "both"),
        ({"verdict": "solver defect", "status": "failed", "missed": 1}, "failed"),
        ({"verdict": "solver defect", "status": "diverged"}, "status"),
        ({"verdict": None, "status": "unsupported"}, None),
    ],
)
def test_what_came_of_a_run(values: dict[str, object], outcome: str | None) -> None:
    assert outcome_of(row(**values)) == outcome


def test_the_shipped_families_span_both_sides() -> None:
    found = {case.name: family for case in shipped() if (family := family_of(case)) is not None}
    assert {"grazing", "two_roots_ballistic"} <= set(found)
    distances = list(found["grazing"].distances.values())
    assert distances == sorted(distances)
    assert min(distances) == -1e-2
    assert max(distances) == 1e-2
    assert 0.0 in distances
    assert min(abs(d) for d in distances if d) <= 1e-15


def test_readings_with_another_surface_are_not_of_a_family() -> None:
    case = load_case(CASES / "hard" / "two_roots.yaml")
    family = family_of(case)
    assert family is not None
    others = {"behind_a_crossing", "beside_a_touch", "three_d1e10", "jump_d2e16", "jump_d2e18", "jump_d2e20"}
    assert {r.name for r in case.readings} - set(family.distances) == others
    assert {r.name for r in family.case.readings} == set(family.distances)


def test_a_case_of_other_differences_is_no_family() -> None:
    assert family_of(load_case(CASES / "fig8.yaml")) is None


def test_the_page_and_its_figure_are_made_of_runs(tmp_path: Path) -> None:
    """Some of its readings; the command makes all of another family."""
    case = load_case(CASES / "hard" / "grazing.yaml")
    case = replace(case, readings=case.readings[:4])
    options = Options(solvers=("henon",), processes=1)
    page = run_atlas(study_request([case], options, tmp_path)).page
    assert page is not None
    rows = read_rows(RunRow, page.with_name("runs.csv"))
    assert len(rows) == len(case.readings) * len(TOLERANCES)
    assert all(own.wall_s_iqr is None for own in rows)
    text = page.read_text(encoding="utf-8")
    assert "![" in text
    assert "(grazing.svg)" in text
    assert "relative tolerance" in page.with_name("grazing.svg").read_text(encoding="utf-8")


def test_neighbours_of_one_outcome_are_one_shape() -> None:
    """A panel of any size is a path an outcome and its grid: what is drawn is as wide and high as the runs are many."""
    case = load_case(CASES / "hard" / "grazing.yaml")
    family = family_of(case)
    assert family is not None
    wrong = {"verdict": "solver defect", "status": "wrong", "missed": 2}
    rows = [
        row(reading=reading, rtol=rtol, **(wrong if 5 <= i < 9 and rtol == 1e-6 else {}))
        for i, reading in enumerate(list(family.distances))
        for rtol in (1e-3, 1e-4, 1e-6)
    ]
    panel = draw_atlas(family, rows).axes[0]
    shapes = {patch.get_facecolor(): patch.get_path() for patch in panel.patches if patch.get_fill()}
    missed, right = (
        shapes[to_rgba(OUTCOMES[outcome][1])].vertices.reshape(-1, 5, 2) for outcome in ("missed", "right")
    )
    assert [(*box[0], *box[2]) for box in missed.tolist()] == [(5, 2, 9, 3)]
    assert [(*box[0], *box[2]) for box in right.tolist()] == [(0, 0, 29, 2), (0, 2, 5, 3), (9, 2, 29, 3)]
    assert len(panel.patches) == 3
