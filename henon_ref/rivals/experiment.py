"""The experiment: all readings of a folder of cases, each behind the fence."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from henon_ref.columns import Row
from henon_ref.model.case import Case
from henon_ref.report.csvfiles import read_rows
from henon_ref.report.manifest import Provenance
from henon_ref.report.ratios import readings_of
from henon_ref.report.write import RUNS
from henon_ref.rivals.duel import Duel, Ratio, duel
from henon_ref.rivals.page import FOLDER, write_page
from henon_ref.score.fence import Answer, Fence, Lane
from henon_ref.score.options import Observer, Options
from henon_ref.score.worker import Failure, Job

_LOG = logging.getLogger(__name__)


def run_rivals(
    cases: Sequence[Case], options: Options, origin: Provenance, out: Path, observer: Observer
) -> Path | None:
    """Time the reference and its rivals in turn on every reading whose report is there, and write the page.

    Parameters
    ----------
    cases : sequence of Case
    options : Options
        Limits are taken from it.
    origin : Provenance
    out : Path
        Folder of the reports, whose rows tell who is to be timed at which setting.
    observer : Observer

    Returns
    -------
    Path or None
        The page; None where no reading has a rival.
    """
    lanes = []
    for case in cases:
        rows = readings_of(read_rows(out / case.name / RUNS))
        jobs = [
            job
            for reading in case.readings
            if (job := duel(rows.get((case.name, reading.name), []), reading.name, reading.problem, options.timeout))
        ]
        lanes += [Lane(case.name, deque(jobs), kin=FOLDER)] if jobs else []
    if not lanes:
        return None
    heard = _Heard(observer)
    Fence(processes=options.processes, memory=options.memory).run(lanes, heard)
    return write_page(heard.rows, heard.failed, origin, out / FOLDER)


class _Heard:
    """Collects the ratios."""

    def __init__(self, observer: Observer) -> None:
        self.observer = observer
        self.rows: list[Row] = []
        self.failed: list[str] = []
        """Readings that could not be timed."""

    def receive(self, lane: Lane, job: Job, stage: str, payload: Any) -> Answer:
        """A reading's ratios are in."""
        if isinstance(job, Duel):
            self.rows += [_row(lane.name, job.reading, ratio) for ratio in payload]
        return Answer(None, job.seconds)

    def finished(self, lane: Lane, job: Job, failure: Failure | None) -> None:
        """A reading is done."""
        if failure is not None and isinstance(job, Duel):
            _LOG.info("%s, %s cannot be timed in turn: %s", lane.name, job.reading, failure.reason)
            self.failed.append(f"{lane.name}, {job.reading}: {failure.reason}")

    def tick(self) -> None:
        """Some time has passed."""
        self.observer.tick()


def _row(case: str, reading: str, ratio: Ratio) -> Row:
    own, rival = ratio.setting, ratio.rival_setting
    return {
        "case": case,
        "reading": reading,
        "worst_error_s": ratio.error_s,
        "rtol": own.rtol,
        "rival": ratio.rival,
        "rival_rtol": rival.rtol,
        "rival_step_s": rival.step,
        "wall_s": ratio.wall_s,
        "rival_wall_s": ratio.rival_wall_s,
        "ratio": ratio.ratio,
        "rounds": ratio.rounds,
    }
