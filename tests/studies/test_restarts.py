"""How libraries are restarted: what the page counts, and what it says of the defaults."""

from __future__ import annotations

from typing import get_args

import pytest

from henon_ref import registry
from henon_ref.columns import RUN_COLUMNS, Row
from henon_ref.registry import RESTARTS
from henon_ref.report.text.restarts import suite_rows
from henon_ref.studies.atlas.family import outcome_of
from henon_ref.studies.restarts.options import options_of
from henon_ref.studies.restarts.page import ENDINGS, default_table, ending, option_table, summary_table
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


def test_a_default_is_set_against_the_best_other_restart() -> None:
    """Runs that only one of them gets right, and the digits of all right runs: rounding is no digit."""
    default, other = registry.restart_of("heyoka"), "none"
    rows = [
        *(run(f"heyoka@{default}", "failed", reading=f"late{k}") for k in range(2)),
        *(run(f"heyoka@{other}", reading=f"late{k}") for k in range(2)),
        run(f"heyoka@{default}", reading="gained"),
        run(f"heyoka@{other}", "wrong", reading="gained"),
        run(f"heyoka@{default}", reading="rounding", digits=13.0),
        run(f"heyoka@{other}", reading="rounding", digits=15.9),
        run(f"heyoka@{default}", reading="idle", digits=None),
        run(f"heyoka@{other}", reading="idle", digits=None),
        run("heyoka@direction", "failed", reading="gained"),
    ]
    (line,) = default_table(rows, suite_rows(rows)).rows
    assert line[:4] == ("`heyoka`", f"`{default}`", "3", "21")
    assert line[5:8] == ("`none`", "4", "30")
    assert line[-2:] == ("1", "2")


def test_an_option_is_set_beside_the_library_as_it_is() -> None:
    """Of runs that were made with and without it."""
    option = next(iter(options_of(["scipy-rk45"])))
    without, with_it = option.without.name, option.with_it.name
    rows = [
        run(without, digits=9.0),
        run(with_it, digits=9.5),
        run(without, "wrong", reading="gained"),
        run(with_it, reading="gained"),
        run(without, reading="alone"),
    ]
    (line,) = option_table([option], rows).rows
    assert line[0] == "`scipy-rk45`"
    assert line[2:] == ("2", "2", "2", "", "1", "9.0", "9.5")


@pytest.mark.parametrize("library", ["heyoka", "cvode-bdf", "scipy-rk45"])
def test_a_default_s_own_row_is_bold(library: str) -> None:
    bold = [line[1] for line in summary_table([run(f"{library}@none")]).rows if line[1].startswith("**")]
    assert bold == [f"**`{registry.restart_of(library)}`**"]
