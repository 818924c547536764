"""Runs from files."""

from __future__ import annotations

from pathlib import Path

from henon_ref.simulation.run_file import read_run
from henon_ref.simulation.solution import Solution


def load_run(path: str | Path) -> Solution:
    """The run that :meth:`Solution.save` has written: the same transitions and sticks, and ``sol(t)`` to the last bit.

    Parameters
    ----------
    path : str or Path

    Raises
    ------
    ArgumentError
        Also a ValueError, for a file that cannot be read, or is none of these.
    """
    run = read_run(path)
    return Solution(run.system, None, run.start, run.initial, run.trajectory, run.steps)
