"""The index of all reports in a folder: which solver to take, who is right where, and what else there is to read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from henon_ref.harness.report.folder import INDEX, REPORT, without_dead_links
from henon_ref.harness.report.text.choice import case_table, choice_table, commits, often_table
from henon_ref.harness.report.text.markdown import environment
from henon_ref.harness.report.text.matrix import MatrixRow
from henon_ref.harness.score.kinds import CLOSE

PAGES = {
    "price": "[Price list](price/README.md): what accuracy costs in time, from one transition to a million seconds",
    "rivals": "[Times in turn](rivals/README.md): `henon` against heyoka and whichever other solver is the cheapest",
    "atlas": "[Atlas](atlas/README.md): tolerance against distance from a graze, or between two roots of one step",
    "restarts": "[How libraries are restarted](restarts/README.md) after an event: each way over all cases",
    "causes": "[Causes](causes/README.md): what the libraries do by themselves, each shown by the library alone",
    "paper": "[The paper](paper/README.md): every number and equation of the paper, computed again",
}
"""Folders of the studies, and how the index leads to them."""


def index_text(rows: Sequence[MatrixRow], folder: Path) -> str:
    """The index as markdown.

    Parameters
    ----------
    rows : sequence of MatrixRow
        Of the matrix.
    folder : Path
        Where it lies: links lead only to what is there.
    """
    text = (
        environment()
        .get_template("index.md.j2")
        .render(
            choice=choice_table(rows).markdown,
            often=often_table(rows).markdown,
            cases=case_table([row for row in rows if (folder / row.case / REPORT).exists()]).markdown,
            commits=commits(rows),
            mean_parts=round(1 / CLOSE),
            pages=[words for page, words in PAGES.items() if (folder / page / INDEX).exists()],
        )
    )
    return without_dead_links(text, folder)
