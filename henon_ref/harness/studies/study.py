"""Common interface of all studies: request, options that each study accepts, and resulting page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the command's help imports this module and must start quickly
    from henon_ref.casefile.case import Case
    from henon_ref.harness.campaign.options import Options
    from henon_ref.harness.campaign.progress import ProgressLine
    from henon_ref.harness.report.manifest import Provenance


@dataclass(frozen=True)
class StudyRequest:
    """Request for a study; the entry of the study in :data:`STUDIES` lists the options that it uses."""

    cases: Sequence[Case]
    options: Options
    """Solvers (None: the study's default), deadline, processes, resuming."""
    origin: Provenance
    folder: Path
    """Folder of the study, in a folder of reports."""
    observer: ProgressLine
    rows: Path | None = None
    """Folder of the reports whose rows the study reads."""


@dataclass(frozen=True)
class StudyResult:
    """Result of a study."""

    page: Path | None
    """None if there was nothing to study."""
    remarks: Sequence[str] = ()
    """Sentences that the command prints in addition to the page."""
    holds: bool = True
    """Whether all checked claims of the page hold."""


@dataclass(frozen=True)
class Study:
    """One study."""

    folder: str
    """Name of the study's folder in a folder of reports."""
    target: str
    """``module:function`` in :mod:`henon_ref.harness.studies`; maps :class:`StudyRequest` to :class:`StudyResult`."""
    summary: str
    takes: tuple[str, ...] = ()
    """Options of the command that the study accepts, in addition to the folder."""
    jobs: int = 2
    """Default number of simultaneous runs; one if the study compares times."""
    nothing: str = ""
    """Message if there is no page."""
    every_run: tuple[str, ...] = ()
    """Files of all runs, which are too long for a repository."""

    def make(self, request: StudyRequest) -> StudyResult:
        """Import the study's module and make its page; OSError if the folder cannot be written."""
        module, _, function = self.target.partition(":")
        result: StudyResult = getattr(import_module(f"henon_ref.harness.studies.{module}"), function)(request)
        return result


STUDIES = {
    "price": Study(
        "price", "price.page:run_price", "Times of every solver at every tolerance, and of the parts of a run.",
        ("cases", "solvers", "jobs", "resume"), jobs=1, every_run=("price.csv", "samples.csv"),
    ),
    "paired-times": Study(
        "rivals", "paired_times:run_paired_times",
        "Times of henon and of the cheapest other solvers, from alternating runs.",
        ("cases", "rows", "timeout", "jobs"), jobs=1,
        nothing="no reading in which henon and another solver reach 3 digits", every_run=("ratios.csv",),
    ),
    "atlas": Study(
        "atlas", "atlas:run_atlas", "Grazes and pairs of roots at decreasing distances, at tolerances from 1e-3 on.",
        ("cases", "solvers", "timeout", "jobs", "resume"),
        nothing="no case whose readings differ in a distance alone, or no solver that has a tolerance",
        every_run=("runs.csv",),
    ),
    "restarts": Study(
        "restarts", "restarts:run_restarts", "Each library with each restart, and defaults that another one surpasses.",
        ("cases", "solvers", "timeout", "jobs", "resume"),
        nothing="no library to restart, or no reading with a stored truth", every_run=("runs.csv",),
    ),
    "causes": Study("causes", "page:run_causes", "Causes of failures, each shown by a run of the library alone."),
    "paper": Study("paper", "paper.page:run_paper", "Every number and equation of the paper, computed again."),
}  # fmt: skip
"""Studies by name."""
