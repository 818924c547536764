"""What a worker does while the command that began it is still reading the cases."""

from __future__ import annotations

from typing import Any

REFERENCE = "henon"
"""The solver that the prelude is for."""


def prelude() -> None:
    """Load what a run of the reference needs: the loop first, which takes seconds where it has to be compiled."""
    from henon_ref.henon import apart
    from henon_ref.henon.loading import load

    load(None)
    apart.table()
    import henon_ref.henon.solvers
    import henon_ref.score.runjob  # noqa: F401


def prepares(job: Any) -> bool:
    """Whether the prelude loads what a job needs: with several surfaces the loop is another one."""
    return job.solver == REFERENCE and len(job.problem.system.surfaces) == 1
