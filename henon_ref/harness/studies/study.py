"""One frame for all studies: what is asked for, what each study takes of it, and the page that it makes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the command's help imports this module, and nothing that computes
    from henon_ref.casefile.case import Case
    from henon_ref.harness.campaign.options import Options
    from henon_ref.harness.campaign.progress import Observer
    from henon_ref.harness.report.manifest import Provenance


def _silent() -> Observer:
    from henon_ref.harness.campaign.progress import Observer

    return Observer()


@dataclass(frozen=True)
class Asked:
    """What a study is asked for; each takes of it what its entry in :data:`STUDIES` says."""

    cases: Sequence[Case]
    options: Options
    """Solvers (None: the study's own), deadline, processes, resuming."""
    origin: Provenance
    folder: Path
    """The study's own, in a folder of reports."""
    observer: Observer = field(default_factory=_silent)
    rows: Path | None = None
    """Folder of the reports whose rows a study starts from; None: that of the study's own folder."""
    tell: Callable[[str], None] = lambda words: None
    """Told what a study without runs is at."""


@dataclass(frozen=True)
class Made:
    """What came of a study."""

    page: Path | None
    """None where there was nothing to study."""
    remarks: Sequence[str] = ()
    """What is said beside the page, a sentence each."""
    holds: bool = True
    """Whether everything that the page claims passes its check."""


@dataclass(frozen=True)
class Study:
    """One study."""

    folder: str
    """Where its page lies in a folder of reports."""
    target: str
    """``module:function`` below :mod:`henon_ref.harness.studies`: a function of :class:`Asked` that returns
    :class:`Made`."""
    summary: str
    takes: tuple[str, ...] = ()
    """What may be asked for, beside the folder."""
    jobs: int = 2
    """Runs at work at once, where nothing is asked for: one where times are compared."""
    nothing: str = ""
    """Said where there is no page."""
    every_run: tuple[str, ...] = ()
    """Files beside the page that hold every run behind it: too long to be kept in a repository."""

    def make(self, asked: Asked) -> Made:
        """Import it, and make its page.

        Raises
        ------
        OSError
            Where its folder cannot be written.
        """
        module, _, function = self.target.partition(":")
        made: Made = getattr(import_module(f"henon_ref.harness.studies.{module}"), function)(asked)
        return made


STUDIES = {
    "price": Study(
        "price", "price.page:run_price", "Times of every solver at every tolerance; what the parts of a run cost.",
        ("cases", "solvers", "jobs", "resume"), jobs=1, every_run=("price.csv", "samples.csv"),
    ),
    "paired-times": Study(
        "rivals", "paired_times:run_paired_times", "Times of henon, in turn with the cheapest other solvers.",
        ("cases", "rows", "timeout", "jobs"), jobs=1,
        nothing="no reading in which henon and another solver get to 3 digits", every_run=("ratios.csv",),
    ),
    "atlas": Study(
        "atlas", "atlas:run_atlas", "Ever closer grazes and pairs of roots, at tolerances from 1e-3 to 1e-13.",
        ("cases", "solvers", "timeout", "jobs", "resume"),
        nothing="no case whose readings differ in a distance alone, or no solver that has a tolerance",
        every_run=("runs.csv",),
    ),
    "restarts": Study(
        "restarts", "restarts:run_restarts", "Every library in every restart; which default another one beats.",
        ("cases", "solvers", "timeout", "jobs", "resume"),
        nothing="no library to restart, or no reading with a stored truth", every_run=("runs.csv",),
    ),
    "causes": Study("causes", "causes:run_causes", "What libraries do by themselves, shown by each library alone."),
    "paper": Study("paper", "paper.page:run_paper", "Everything that the paper computes, set against the paper."),
}  # fmt: skip
"""Name -> study."""
