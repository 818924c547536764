"""The page of paired times over all reports: how the ratios spread, and where another solver is faster."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from henon_ref.report.files.manifest import Provenance
from henon_ref.report.text.paired_times import RATIOS, PairRow, own_words, slower_table, spread_table
from henon_ref.report.text.ranking import LEVELS, readings_of
from henon_ref.rows import RunRow, rows_text
from henon_ref.studies.page import write
from henon_ref.text import markdown


def write_page(
    rows: Sequence[PairRow],
    failed: Sequence[str],
    left: Mapping[str, Sequence[str]],
    runs: Sequence[RunRow],
    origin: Provenance,
    folder: Path,
) -> Path:
    """Write ratios and page.

    Parameters
    ----------
    rows : sequence of PairRow
    failed : sequence of str
        Readings that could not be timed, and why.
    left : mapping of sequences of str
        Readings in which there is nothing to time, as links, by the reason.
    runs : sequence of RunRow
        Rows of the reports that told whom to time.
    origin : Provenance
    folder : Path
        The experiment's own folder; made if need be.

    Raises
    ------
    OSError
        Where it cannot be written.
    """
    slower = slower_table(rows, runs)
    context = {
        "readings": len({row.problem for row in rows}),
        "total": len(readings_of(runs)),
        "left": left,
        "fewest": LEVELS[0],
        "own": own_words(rows),
        "spread": spread_table(rows).markdown,
        "slower": slower.markdown if slower.rows else "",
        "failed": [markdown(each) for each in failed],
        "origin": origin,
    }
    return write(folder, "paired_times", context, {RATIOS: rows_text(PairRow, rows)})
