"""Why a run ends before its horizon, in the words of its status."""

from __future__ import annotations

import math
from itertools import takewhile
from typing import TYPE_CHECKING

from henon_ref.henon.registers import ACCUMULATED, DIVERGED, I_GUARD, STALLED
from henon_ref.model.decision import ended
from henon_ref.model.equations import Guard
from henon_ref.trajectory import Status

if TYPE_CHECKING:
    from henon_ref.henon.session import Session


def why_ended(run: Session, code: int) -> tuple[Status, str]:
    """Status and reason of a run that stands where the loop said DIVERGED, STALLED, ACCUMULATED or INVALID."""
    at = f"t = {run.time:.17g}"
    largest = max(map(abs, run.x.tolist()))
    grown = largest > 1e8 * max(1.0, *(abs(v[0]) for v in run.start.x))
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
    next_to_nothing = 1e-14 * max(1.0, abs(run.start.time[0]), abs(run.time))
    for g, guard in enumerate(run.guards):
        if guard.ends and abs(run.engine.scratch.band.item(run.x.size + g, 0)) <= next_to_nothing:
            return guard
    return None


def _singular(run: Session) -> str:
    """What has no finite series where the run stalled, or the steepest one, by the last that was tried."""
    system, order, states = run.engine.system, run.engine.order, run.x.size
    series = run.engine.scratch.band[: states + len(run.guards), : order + 1].tolist()
    finite = [sum(1 for _ in takewhile(math.isfinite, row)) for row in series]
    # What is not finite spreads: to a state one order after the field that it is integrated from.
    at = finite.index(min(finite))
    singular = finite[at] > (1 if at < states else 0)
    if finite[at] > order:
        steep = [abs(row[order]) / (abs(row[0]) + abs(row[1]) + abs(row[2]) + 1e-300) for row in series]
        at = steep.index(max(steep))
    what = "singular" if singular else "not finite"
    if at < states:
        return f"the field of {system.state_names[at]} is {what}"
    guard = run.guards[at - states]
    of = str(system.valid[guard.index]) if guard.kind == "valid" else system.sign_names[guard.index]
    words = {"valid": "", "surface": "the surface of ", "attracts": "whether sliding attracts on "}
    return f"{words.get(guard.kind, 'the release of ')}{of} is {what}"
