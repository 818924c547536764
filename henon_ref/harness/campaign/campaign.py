"""Comparison of solvers: every solver on every reading of some cases, in a pool of workers."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import TypeVar

from henon_ref.casefile.case import Case
from henon_ref.errors import CaseError
from henon_ref.harness.campaign import WORKERS_NEED
from henon_ref.harness.campaign.case_campaign import CaseCampaign, Deliver, Draw
from henon_ref.harness.campaign.comparison import Comparison
from henon_ref.harness.campaign.options import Options, check_solvers
from henon_ref.harness.campaign.progress import ProgressLine, is_seen
from henon_ref.jit.cache_folder import cache_root
from henon_ref.solver import Solver
from henon_ref.system.python_arguments import explained
from henon_ref.workers.pool import WorkerPool

T = TypeVar("T")


@explained
def compare(
    case: Case,
    *,
    solvers: Sequence[str | Solver] | None = None,
    tolerances: Sequence[float] | None = None,
    repeats: int | None = None,
    timeout: float = 10.0,
    processes: int = 2,
    progress: bool | None = None,
) -> Comparison:
    """Run every solver on every reading of a case and score the runs against the truth.

    Each run takes place in a worker, a separate process with limits on time and memory. If a solver hangs or crashes,
    its row reports that. An interrupt (Ctrl-C, the stop button of a notebook) ends all workers. A script requires an
    ``if __name__ == "__main__"`` guard only if it has threads and passes a solver that it defines itself. In a
    notebook, a solver of your own must be imported from a module.

    Parameters
    ----------
    case : Case
        From :func:`henon_ref.load_case`.
    solvers : sequence of str or Solver, optional
        Names or instances; None: the solvers that the case lists, or the default solvers if it lists none.
    tolerances : sequence of float, optional
        Relative tolerances that replace those of the case, each at least 1e-16 and below 1.
    repeats : int, optional
        Timing samples per row, at least 1; None: as many as fit into a fraction of a second.
    timeout : float
        Limit on the processor time of one run [s], at least 0.01.
    processes : int
        Number of concurrent runs, at least 1.
    progress : bool, optional
        Whether to show the number of finished rows on standard error; None: only in a terminal or a notebook.

    Returns
    -------
    Comparison

    Raises
    ------
    CaseError
        If an argument is not allowed, for example an unknown solver or a tolerance of 0, or if no solver applies to
        the case.
    """
    if not isinstance(case, Case):
        raise CaseError(f"case is {case!r}, wanted a Case: henon_ref.load_case(path) reads one")
    options = Options(
        solvers=_listed("solvers", solvers),
        tolerances=_listed("tolerances", tolerances),
        repeats=repeats,
        timeout=timeout,
        processes=processes,
    )
    if progress not in (None, True, False):
        raise CaseError(f"progress is {progress!r}, wanted None, True or False")
    found: list[Comparison] = []
    shown = sys.stderr is not None and (is_seen(sys.stderr) if progress is None else progress)
    with ProgressLine(sys.stderr if shown else None, case.name) as line:
        compare_all([case], options, found.append, observer=line)
    return found[0]


def _listed(name: str, values: Sequence[T] | None) -> tuple[T, ...] | None:
    """Convert an argument to a tuple; refuse a single string or number."""
    if values is None:
        return None
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise CaseError(f"{name} is {values!r}, wanted a sequence: {name}=[{values!r}]")
    return tuple(values)


def compare_all(
    cases: Sequence[Case],
    options: Options,
    deliver: Deliver,
    *,
    draw: Draw | None = None,
    observer: ProgressLine | None = None,
) -> None:
    """Compare several cases; deliver the comparison of each case after its last run.

    ``draw`` returns the job that draws the figures of a reading after its rows are finished; None: no figures and no
    samples. Without an ``observer``, no progress is shown. CaseError if a solver is unknown, or if none of the
    requested solvers applies to a case.
    """
    cache_root()  # chooses a usable cache folder, which the workers inherit
    check_solvers(cases, options)
    observer = observer or ProgressLine(None)
    pool = WorkerPool(workers=options.processes, memory=options.memory, main=options.of_main, modules=WORKERS_NEED)
    campaigns = [CaseCampaign(case, options, pool, deliver, draw, observer) for case in cases]
    observer.stage("truths", sum(own.fetch_truths() for own in campaigns))
    pool.run(observer.tick)
    waiting = sum(own.queue_runs() for own in campaigns)
    kept = sum(len(own.rows) for own in campaigns)
    observer.stage("rows", waiting + kept, kept)
    pool.run(observer.tick)
    for own in campaigns:
        if not own.delivered:  # all rows came from the journal, and no figure is drawn
            own.finish()
