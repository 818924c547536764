"""The price list's page: everything that was measured is on it, and every file that it links to is there."""

from __future__ import annotations

import re
from pathlib import Path

from henon_ref.harness.report.manifest import provenance
from henon_ref.harness.rows import RunRow, read_rows
from henon_ref.harness.studies.paired_times.timing import TimedPair
from henon_ref.harness.studies.price.compiling import Ready
from henon_ref.harness.studies.price.growth import Horizon
from henon_ref.harness.studies.price.ladder import SampleRow
from henon_ref.harness.studies.price.landings import Landed
from henon_ref.harness.studies.price.operations import Work
from henon_ref.harness.studies.price.page import Prices, write_page
from henon_ref.harness.studies.price.states import Size


def run(solver: str, wall: float, iqr: float | None) -> RunRow:
    own = {"case": "c", "reading": "late", "solver": solver, "rtol": 1e-9, "verdict": "right", "status": "ok"}
    counts = {"digits": 9.5, "max_time_error_s": 3e-10, "rhs_evaluations": 50, "steps": 10, "wall_s": wall}
    return RunRow(**own | counts, wall_s_iqr=iqr)


def prices() -> Prices:
    pair = TimedPair(
        "c", "late", 9, "heyoka", rtol=1e-9, rival="heyoka", rival_rtol=1e-9, rival_step_s=None, wall_s=1e-5,
        rival_wall_s=4e-5, ratio=0.25, ratio_low=0.2, ratio_high=0.3, rounds=3, rival_own_s=2e-5,
        samples_s=(1e-5,) * 3, rival_samples_s=(4e-5,) * 3,
    )  # fmt: skip
    landings = ("henon", "henon-newton", "henon-brent")
    return Prices(
        rows=[run("henon", 1e-5, 1e-7), run("heyoka", 4e-5, 1e-5), run("scipy-dop853", 1e-2, None)],
        pairs=[pair],
        failed=["c, late, against ida: it *died*"],
        ready=[Ready("c", "late", "henon", 1e-9, 1e-5, 4.0, 1.0)],
        landings=[Landed("c", "late", solver, 5, 2.0, 1e-5, 0.75, 1e-15) for solver in landings],
        work=Work(100, 50, 10, 20, 20, 4, 6, 30, 1e-5, 1e10),
        effects=[],
        growth=[Horizon("henon", until, 10, 1e-3, 0.0, 1e-13) for until in (1e3, 1e4)],
        sizes=[Size(2, solver, 5, 1.0, 1e-5, 1.0, 10, 1e-5, 1.0, True) for solver in ("henon", "heyoka")],
    )


def test_the_page_shows_what_was_measured_and_every_link_leads_to_a_file(tmp_path: Path) -> None:
    text = write_page(prices(), provenance("make it again"), tmp_path).read_text(encoding="utf-8")
    links = {link for link in re.findall(r"\]\(([^)]+)\)", text) if not link.startswith(("#", "../"))}
    assert {path.name for path in tmp_path.iterdir()} == links | {"README.md"}
    assert len(read_rows(RunRow, tmp_path / "price.csv")) == 3
    assert len(read_rows(SampleRow, tmp_path / "samples.csv")) == 2
    assert "## c, late" in text
    assert "| 4 (3.3 to 5) | 2 |" in text
    assert "| `heyoka`, its own calls alone |  |  | 2 |  |" in text
    assert "its own calls of `propagate_until` are 50%" in text
    assert "Times in the figure: 3; 1 scatter" in text
    assert "1 rest on one or two runs" in text
    assert "| 0.75 |  |\n" in text
    assert "Not timed: c, late, against ida: it \\*died\\*" in text
    assert "    make it again\n" in text
