"""The picture of a run that commands write: the phase portrait with its transitions, and states over time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from henon_ref.errors import CaseError
from henon_ref.text import listed

if TYPE_CHECKING:
    from henon_ref.simulation.solution import Solution

KINDS = (".png", ".svg", ".pdf")
"""Endings of a picture's name."""
WIDTH, HEIGHT = 10.0, 4.6
"""Of a picture [in]."""


def check_picture(path: Path) -> None:
    """Refuse the name of a picture before anything is run.

    Raises
    ------
    CaseError
        For an ending that is none of :data:`KINDS`, and a folder that is not there.
    """
    if path.suffix.lower() not in KINDS:
        raise CaseError(f"{path}: a picture's name ends with {listed(KINDS)}")
    if not path.parent.is_dir():
        raise CaseError(f"{path}: there is no folder {path.parent}")


def write_picture(path: Path, run: Solution) -> None:
    """Write the picture of a run.

    Raises
    ------
    HenonRefError
        Where there is nothing to draw, or it cannot be written.
    """
    from henon_ref.figures import style

    with style.figure(HEIGHT, width=WIDTH) as figure:
        figure.set_layout_engine("constrained")
        grid = figure.add_gridspec(2, 2, width_ratios=(1.15, 1))
        run.plot(ax=figure.add_subplot(grid[:, 0]), transitions=True)
        upper = figure.add_subplot(grid[0, 1])
        lower = figure.add_subplot(grid[1, 1], sharex=upper)
        names = [*run.system.state[:2], *run.system.model.sign_names][:2]
        run.plot_time(*names, ax=[upper, lower][: len(names)])
        if len(names) < 2:
            lower.remove()
    try:
        path.write_bytes(style.image(figure, path.suffix.lower()[1:]))
    except OSError as error:
        raise CaseError(f"cannot write {path}: {error.strerror or error}") from None
