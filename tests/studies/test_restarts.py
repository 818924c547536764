"""How libraries are restarted: what the page counts, and what it says of the defaults."""

from __future__ import annotations

from typing import get_args

import pytest

from henon_ref.columns import RUN_COLUMNS, Row
from henon_ref.registry import RESTARTS
from henon_ref.studies.atlas.family import outcome_of
from henon_ref.studies.restarts.page import ENDINGS, default_table, ending, libraries_of, summary_table
from henon_ref.trajectory import Status


def run(
    solver: str, status: str = "ok", *, reading: str = "default", digits: float | None = 9.0, missed: int = 0
) -> Row:
    """A run with a row's columns; right where it is ok."""
    verdict = "right" if status == "ok" else "solver defect"
    own = {"case": "made_up", "reading": reading, "solver": solver, "rtol": 1e-6, "status": status, "verdict": verdict}
    return dict.fromkeys(RUN_COLUMNS) | own | {"digits": digits, "missed": missed, "spurious": 0}


def test_every_run_is_counted_once_however_it_ends() -> None:
    """A run that ends by a status of its own has missed what comes after; it is neither wrong nor failed."""
    rows = [
        run("heyoka@none"),
        run("heyoka@none", "wrong", missed=1),
        run("heyoka@none", "nonunique", missed=110),
        run("heyoka@none", "diverged", missed=2),
        run("heyoka@none", "failed", missed=4),
        run("heyoka@none", "timeout", missed=8),
        run("heyoka@none", "unavailable"),
    ]
    none = summary_table(rows).rows[-1]
    assert none == ("`heyoka`", "`none`", "1", "1", "2", "2", "125", "", "")


def test_every_status_of_the_contract_is_counted() -> None:
    rows = [run(f"heyoka@{r}", status, missed=m) for r in RESTARTS for status in get_args(Status) for m in (0, 1)]
    made = [row for row in rows if outcome_of(row) is not None]
    counted = [line[2 : 2 + len(ENDINGS)] for line in summary_table(rows).rows]
    assert sum(int(cell or 0) for line in counted for cell in line) == len(made)
    assert any(ending(row) == "ended early" for row in rows)


def test_runs_that_another_restart_gets_right_are_counted() -> None:
    rows = [
        run("heyoka@none", "wrong"),
        run("heyoka@none", "failed", reading="by none"),
        run("heyoka@none", reading="by both"),
        run("heyoka@offset"),
        run("heyoka@offset", "wrong", reading="by none"),
        run("heyoka@offset", reading="by both"),
        run("ida@none", "wrong"),
    ]
    table = summary_table(rows)
    assert table.headings[-1] == "right by another restart"
    counted = {line[:2]: line[-1] for line in table.rows if line[-1]}
    assert counted == {("`heyoka`", "`none`"): "1"}


def test_a_default_is_set_against_the_restart_that_is_right_most_often() -> None:
    """Sequences that only one of them gets, and digits where both do: rounding is no digit."""
    rows = [
        *(run("heyoka@offset", "failed", reading=f"late{k}") for k in range(2)),
        *(run("heyoka@event-free-step", reading=f"late{k}") for k in range(2)),
        run("heyoka@offset", reading="gained"),
        run("heyoka@event-free-step", "wrong", reading="gained"),
        run("heyoka@offset", reading="near", digits=15.9),
        run("heyoka@event-free-step", reading="near", digits=3.0),
        run("heyoka@offset", reading="rounding", digits=13.0),
        run("heyoka@event-free-step", reading="rounding", digits=15.9),
        run("heyoka@offset", reading="idle", digits=None),
        run("heyoka@event-free-step", reading="idle", digits=None),
        run("heyoka@none", "failed", reading="near"),
    ]
    assert default_table(rows).rows == [("`heyoka`", "`offset`", "`event-free-step`", "1", "2", "1", "")]
    assert libraries_of(rows) == ["heyoka"]


def test_of_restarts_that_are_right_as_often_the_one_with_more_digits_counts() -> None:
    rows = [run(f"cvode-bdf@{restart}", digits=5.0) for restart in ("event-free-step", "offset", "none")]
    assert default_table([*rows, run("cvode-bdf@direction")]).rows[0][2:] == ("`direction`", "", "", "", "1")


@pytest.mark.parametrize("library", ["heyoka", "cvode-bdf", "scipy-rk45"])
def test_a_default_s_own_row_is_bold(library: str) -> None:
    bold = [line[1] for line in summary_table([run(f"{library}@none")]).rows if line[1].startswith("**")]
    assert bold == ["**`offset`**" if library == "heyoka" else "**`event-free-step`**"]
