"""Job of a worker that draws the figures of a reading."""

from __future__ import annotations

from dataclasses import dataclass
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


@dataclass(frozen=True)
class FigureJob(Job):
    """Draw the figures of one reading; the result maps file names to contents."""

    content: Reading
    expected: Expected | None
    samples: Samples | None
    records: tuple[Record, ...]

    @property
    def reading(self) -> str:
        return self.content.name

    @property
    def seconds(self) -> float:
        return DRAW_SECONDS

    def run(self, state: WorkerState) -> dict[str, bytes]:
        drawn = zip(KINDS, self._figures(), strict=True)
        return {file_name(self.reading, kind): svg(figure) for kind, figure in drawn if figure is not None}

    def _figures(self) -> list[Figure | None]:
        """Draw the figures in the order of ``KINDS``; None if there is nothing to draw."""
        from henon_ref.figures.motion import draw_portrait, motion_of
        from henon_ref.figures.scene import draw_scene
        from henon_ref.figures.time_series import draw_modes
        from henon_ref.harness.figures.cost import draw_cost
        from henon_ref.harness.figures.errors import draw_errors

        reading, expected = self.content, self.expected
        scene = draw_scene(reading.scene) if reading.scene is not None else None
        if expected is None:
            return [scene, *4 * [None]]
        motion = motion_of(self.samples, expected.transitions) if self.samples is not None else None
        return [
            scene,
            draw_portrait(reading, motion) if motion is not None else None,
            draw_modes(reading, motion) if motion is not None else None,
            draw_errors([(record.run, record.transitions) for record in self.records], expected),
            draw_cost([record.run for record in self.records], expected),
        ]


def figure_job(result: ReadingResult, records: list[Record]) -> FigureJob:
    return FigureJob(result.reading, result.expected, result.samples, tuple(records))


def file_name(reading: str, kind: str) -> str:
    return f"{reading}_{kind}.svg"
