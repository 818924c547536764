"""Job of a worker that draws the figures of a reading."""

from __future__ import annotations

from typing import TYPE_CHECKING

from henon_ref.casefile.case import Reading
from henon_ref.harness.campaign.comparison import ReadingResult
from henon_ref.harness.campaign.rows import Record
from henon_ref.harness.report.svg import svg
from henon_ref.harness.score.reference import Expected
from henon_ref.trajectory import Samples
from henon_ref.workers.worker import Job, WorkerState

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DRAW_SECONDS = 120.0
"""Limit on the processor time of the figures of a reading [s]."""
KINDS = ("scene", "portrait", "modes", "errors", "cost")
"""Kinds of figures of a reading, which are part of their file names."""


def figure_job(result: ReadingResult, records: list[Record]) -> Job:
    """Return the job that draws the figures of one reading; its result maps file names to contents."""
    return Job(drawn, (result.reading, result.expected, result.samples, tuple(records)), DRAW_SECONDS)


def drawn(
    state: WorkerState,
    reading: Reading,
    expected: Expected | None,
    samples: Samples | None,
    records: tuple[Record, ...],
) -> dict[str, bytes]:
    """Draw the figures of one reading; return file names and contents."""
    figures = zip(KINDS, _figures(reading, expected, samples, records), strict=True)
    return {file_name(reading.name, kind): svg(figure) for kind, figure in figures if figure is not None}


def _figures(
    reading: Reading, expected: Expected | None, samples: Samples | None, records: tuple[Record, ...]
) -> list[Figure | None]:
    """Draw the figures in the order of ``KINDS``; None if there is nothing to draw."""
    from henon_ref.figures.motion import draw_portrait, motion_of
    from henon_ref.figures.scene import draw_scene
    from henon_ref.figures.time_series import draw_modes
    from henon_ref.harness.figures.cost import draw_cost
    from henon_ref.harness.figures.errors import draw_errors

    scene = draw_scene(reading.scene) if reading.scene is not None else None
    if expected is None:
        return [scene, *4 * [None]]
    motion = motion_of(samples, expected.transitions) if samples is not None else None
    return [
        scene,
        draw_portrait(reading, motion) if motion is not None else None,
        draw_modes(reading, motion) if motion is not None else None,
        draw_errors([(record.run, record.transitions) for record in records], expected),
        draw_cost([record.run for record in records], expected),
    ]


def file_name(reading: str, kind: str) -> str:
    return f"{reading}_{kind}.svg"
