"""Why a run ends before its horizon, in the words of its status."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from henon_ref.henon.registers import ACCUMULATED, DIVERGED, I_GUARD, STALLED
from henon_ref.model.decision import ended
from henon_ref.model.equations import Guard
from henon_ref.trajectory import Status

if TYPE_CHECKING:
    from henon_ref.henon.session import Session


def why_ended(run: Session, code: int) -> tuple[Status, str]:
    """Status and reason of a run that stands where the loop said DIVERGED, STALLED, ACCUMULATED or INVALID."""
    at = f"t = {run.time:.17g}"
    grown = np.abs(run.x).max() > 1e8 * max(1.0, *(abs(v[0]) for v in run.start.x))
    if code == DIVERGED or (code == STALLED and grown):
        return "diverged", f"the state leaves every bound at {at}"
    singular = _shrunk(run) if code == STALLED else None
    if singular is not None:
        return _fallen(run, singular)
    if code == STALLED:
        return "failed", f"the step size fell to zero at {at}: {_singular(run)} there"
    if code == ACCUMULATED:
        return "failed", f"transitions accumulate at {at}: no mode lasts longer than the resolution of time"
    return _fallen(run, run.guards[run.integers[I_GUARD]])


def _fallen(run: Session, guard: Guard) -> tuple[Status, str]:
    """How the run ends here for a guard that ends it."""
    refused = ended(run.engine.system, run.mode, [guard], f"{run.time:.17g}")
    assert refused is not None
    return refused.ending, refused.reason


def _shrunk(run: Session) -> Guard | None:
    """A guard that ends the run and has shrunk to nothing where it stalled (the field may be singular there)."""
    for g, guard in enumerate(run.guards):
        value = run.engine.scratch.band[run.x.size + g, 0]
        if guard.ends and abs(value) <= 1e-14 * max(1.0, abs(run.start.time[0]), abs(run.time)):
            return guard
    return None


def _singular(run: Session) -> str:
    """What has no finite series where the run stalled, or the steepest one, by the last that was tried."""
    system, order = run.engine.system, run.engine.order
    series = run.engine.scratch.band[: run.x.size + len(run.guards), : order + 1]
    finite = np.isfinite(series)
    at = int(np.argmin(finite.all(axis=1)))
    if finite[at].all():
        at = int(np.argmax(np.abs(series[:, order]) / (np.abs(series[:, :3]).sum(axis=1) + 1e-300)))
    if at < run.x.size:
        return f"the field of {system.state_names[at]} is {'singular' if finite[at, 1] else 'not finite'}"
    guard = run.guards[at - run.x.size]
    of = str(system.valid[guard.index]) if guard.kind == "valid" else system.sign_names[guard.index]
    words = {"valid": "", "surface": "the surface of ", "attracts": "whether sliding attracts on "}
    what = words.get(guard.kind, "the release of ") + of
    return f"{what} is {'singular' if finite[at, 0] else 'not finite'}"
