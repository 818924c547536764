"""How libraries are restarted: what the page shows of the suite, of the defaults and of the libraries' options."""

from __future__ import annotations

import pytest

from henon_ref.harness import registry
from henon_ref.harness.rows import RunRow
from henon_ref.harness.studies.restart_tables import suite_rows
from henon_ref.harness.studies.restarts import default_table, option_rows, option_table, options_of, summary_table


def run(
    solver: str, status: str = "ok", *, reading: str = "default", digits: float | None = 9.0, missed: int = 0
) -> RunRow:
    """A run with a row's columns; right where it is ok."""
    verdict = "right" if status == "ok" else "solver defect"
    own = {"case": "made_up", "reading": reading, "solver": solver, "rtol": 1e-6, "status": status, "verdict": verdict}
    return RunRow(**own, digits=digits, missed=missed, spurious=0)


def test_every_run_is_counted_once_however_it_ends() -> None:
    rows = [
        run("heyoka@none"),
        run("heyoka@none", "wrong", missed=1),
        run("heyoka@none", "nonunique", missed=110),
        run("heyoka@none", "diverged", missed=2),
        run("heyoka@none", "failed", missed=4),
        run("heyoka@none", "timeout", missed=8),
        run("heyoka@none", "unavailable"),
    ]
    none = summary_table(suite_rows(rows)).rows[-1]
    assert none == ("`heyoka`", "`none`", "1", "1", "2", "2", "125", "", "")


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
    table = summary_table(suite_rows(rows))
    assert table.headings[-1] == "right by another restart"
    counted = {line[:2]: line[-1] for line in table.rows if line[-1]}
    assert counted == {("`heyoka`", "`none`"): "1"}


def test_a_default_is_set_against_the_best_other_restart() -> None:
    """Right runs, and the digits of these: rounding is no digit."""
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
    (line,) = default_table(suite_rows(rows)).rows
    assert line[:5] == ("`heyoka`", "1", f"`{default}`", "3", "21")
    assert line[6:9] == ("`none`", "4", "30")


def test_an_option_is_set_beside_the_library_as_it_is() -> None:
    """Of runs that were made with and without it, by the library in its default restart."""
    option = next(iter(options_of(["scipy-rk45"])))
    without, with_it = registry.with_restart("scipy-rk45", registry.restart_of("scipy-rk45")), option.solver.name
    assert without != with_it
    rows = [
        run(without, digits=9.0),
        run(with_it, digits=9.5),
        run(without, "wrong", reading="gained"),
        run(with_it, reading="gained"),
        run(without, reading="alone"),
        run(without, reading="idle", digits=None),
        run(with_it, reading="idle", digits=None),
    ]
    (line,) = option_table(option_rows([option], rows)).rows
    assert line[0] == "`scipy-rk45`"
    assert line[2:] == ("3", "2", "3", "0", "1", "9", "9.5")


def test_an_option_is_tried_of_a_library_that_runs() -> None:
    assert [option.library for option in options_of(["heyoka", "ida"])] == ["heyoka"]


@pytest.mark.parametrize("library", ["heyoka", "cvode-bdf", "scipy-rk45"])
def test_a_default_s_own_row_is_bold(library: str) -> None:
    table = summary_table(suite_rows([run(f"{library}@none")]))
    bold = [line[1] for line in table.rows if line[1].startswith("**")]
    assert bold == [f"**`{registry.restart_of(library)}`**"]
