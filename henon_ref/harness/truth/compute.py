"""The truth of a reading: loaded if stored, else computed by two routes that have to agree, and stored.

A proof has priority: if ball arithmetic encloses a transition, the enclosure gives digits and radius of the truth, and
heyoka's digits must be within it, or there is no truth. After the end of the proof, heyoka's digits are used, and the
truth is marked as not certified, with the reason. If heyoka is not installed, the truth ends where the proof ends, and
its method says so. Closed forms of the case replace computed times after they have been found to agree.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from decimal import Decimal, localcontext
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from flint import arb

from henon_ref.enclosure.balls import enclose
from henon_ref.harness.truth import store
from henon_ref.harness.truth.reference import (
    CLOSED_FORM_BITS,
    OUT_OF_TIME,
    ReferenceTransition,
    Route,
    Truth,
    TruthError,
)
from henon_ref.modes.kinks import visible
from henon_ref.precision import working_precision

if TYPE_CHECKING:
    from henon_ref.casefile.case import Case, Reading

log = logging.getLogger(__name__)

COMPUTED_SECONDS = 120.0
"""Processor time limit of heyoka's route if no truth is stored [s]; the truth then ends where heyoka stopped."""
PROOF_SECONDS = 60.0
"""Wall time limit of a proof if no truth is stored [s]."""
BARREN_SECONDS = 3.0
"""Time limit of a proof if the run fails before its first transition, so that there is little to prove [s]."""

Progress = Callable[[str, float], None]
"""Called with the name of a stage and the part of it that is done, 0 to 1."""


def truth_for(case: Case, reading: Reading, *, folder: Path | None = None) -> Truth:
    """Return the truth of a reading: the stored one if the hash of its mathematics matches, else a computed one.

    ``folder`` has the stored truths; by default ``cases/truth`` (see :func:`henon_ref.harness.truth.store.folder_of`),
    and if the file there is unusable, the user's cache. A computed truth is stored unless that would replace a file
    outside the user's cache: an unusable file in ``cases/truth`` is kept. Nothing is stored in an installed package. A
    truth is not stored if heyoka is not installed but would continue it, or if a time limit stopped it.

    TruthError if two routes, or a route and a closed form, contradict each other; nothing is stored then.
    """
    if (stored := stored_truth(case, reading, folder)) is not None:
        return stored
    proof, barren, computed = PROOF_SECONDS, BARREN_SECONDS, COMPUTED_SECONDS
    truth = compute(case, reading, proof_seconds=proof, barren_seconds=barren, computed_seconds=computed)
    if not truth.certified and (not heyoka_installed() or truth.reason.startswith(OUT_OF_TIME)):
        return truth
    places = [place for place in _places(case, folder) if not store.inside_package(place)]
    free = [place for place in places[:-1] if not os.path.lexists(store.path_of(place, case.name, reading.name))]
    for place in (*free, *places[-1:]):
        try:
            store.save(place, truth)
            break
        except OSError as error:
            log.warning("the truth of %s, %s is not kept in %s: %s", case.name, reading.name, place, error)
    return truth


def stored_truth(case: Case, reading: Reading, folder: Path | None = None) -> Truth | None:
    """Return the stored truth if it belongs to the reading's mathematics and agrees with the claims of its case.

    ``folder`` as in :func:`truth_for`. An unusable file next to the cases gives a warning.
    """
    for place in _places(case, folder):
        try:
            stored = store.load(place, case.name, reading.name)
        except store.StoredTruthError as error:
            tell(error)
            continue
        if stored is None:
            continue
        if stored.mathematics_hash == reading.mathematics_hash and claimed(stored, reading):
            return stored
        if place != store.user_folder():
            path = store.path_of(place, case.name, reading.name)
            _tell_once(f"{path} is the truth of what the case said before", ", henon-ref truth replaces it")
    return None


def _places(case: Case, folder: Path | None) -> tuple[Path, ...]:
    """Folders that may hold a truth, in the order in which they are tried for loading and storing."""
    if folder is not None:
        return (folder,)
    return tuple(dict.fromkeys((store.folder_of(case.path), store.user_folder())))


def tell(error: store.StoredTruthError) -> None:
    """Warn that a file is not a stored truth."""
    _tell_once(str(error))


@cache
def _tell_once(words: str, mend: str = "") -> None:
    """Warn once per process, since several parts of a command look at the same file."""
    log.warning("%s; it is not used, the truth is computed anew%s", words, mend)


def claimed(stored: Truth, reading: Reading) -> bool:
    """Whether a truth agrees with what its case claims now; the hash of the mathematics does not cover claims."""
    times, modes = (reading.exact.transition_times, reading.exact.modes) if reading.exact else ((), ())
    known = [t for t in stored.transitions if t.closed_form]
    if len(known) != len(times) or [t.to_mode for t in stored.transitions[: len(modes)]] != list(modes):
        return False
    try:
        _check_end(reading, stored)
    except TruthError:
        return False
    with working_precision(CLOSED_FORM_BITS):
        return all(abs(enclose(time) - arb(t.time_digits)) <= t.radius for time, t in zip(times, known, strict=True))


def compute(
    case: Case,
    reading: Reading,
    *,
    proof_seconds: float | None = None,
    barren_seconds: float | None = None,
    computed_seconds: float | None = None,
    progress: Progress | None = None,
) -> Truth:
    """Compute the truth of a reading by both routes.

    ``proof_seconds``: time limit of the proof; ``barren_seconds``: the same if the run fails before its first
    transition (None: ``proof_seconds``); ``computed_seconds``: processor time limit of heyoka's route. None: no limit.

    TruthError if the routes, or a route and a closed form, contradict each other.
    """
    # Imported here: these libraries take half a second, which reading a stored truth does not need.
    from henon_ref.harness.truth.conditioning import conditioning
    from henon_ref.harness.truth.proofs import prove, with_closed_forms
    from henon_ref.harness.truth.reference import with_short_state

    problem, seconds, computed = reading.problem, proof_seconds, None
    if heyoka_installed():
        from henon_ref.harness.truth.multiprecision.route import multiprecision

        computed = multiprecision(problem, progress=_stage(progress, "heyoka"), seconds=computed_seconds)
        if computed.status == "failed" and not computed.transitions and barren_seconds is not None:
            seconds = barren_seconds
    proof = prove(problem, seconds=seconds, progress=_stage(progress, "proof"))
    where = f"{case.name}, {reading.name}"
    proof = replace(proof, transitions=tuple(visible(problem.system, proof.transitions)))
    if computed is not None:
        computed = replace(computed, transitions=tuple(visible(problem.system, computed.transitions)))
    if computed is None:
        proof = replace(proof, method=f"{proof.method} (alone: heyoka is not installed)")
        truth = _truth(case.name, reading, proof, (proof,), proof.transitions, proof.undecided)
    else:
        truth = _combined(case.name, reading, computed, proof, where)
    transitions = truth.transitions
    try:
        if reading.exact is not None:
            transitions = with_closed_forms(transitions, reading.exact.transition_times, reading.exact.modes)
        _check_end(reading, truth)
    except TruthError as error:
        raise TruthError(f"{where}: {error}") from None
    numbers = conditioning(problem, transitions)
    transitions = tuple(replace(with_short_state(t), conditioning=c) for t, c in zip(transitions, numbers, strict=True))
    return replace(truth, transitions=transitions)


def _check_end(reading: Reading, truth: Truth) -> None:
    expect = reading.expect
    if expect is None:
        return
    if expect.status != truth.status:
        raise TruthError(f"the case expects status {expect.status}, computed is {truth.status} ({truth.reason})")
    if expect.time is not None:
        late = truth.end_time - float(expect.time)
        extrapolated = 1e-12 * max(abs(truth.end_time), abs(float(expect.time)))  # as the time of a blow-up is
        if abs(late) > truth.end_radius + extrapolated:
            raise TruthError(
                f"the case expects the end at t = {float(expect.time):.17g}, computed is {truth.end_digits}"
            )


def _stage(progress: Progress | None, name: str) -> Callable[[float], None] | None:
    return None if progress is None else lambda done: progress(name, done)


def _combined(case: str, reading: Reading, computed: Route, proof: Route, where: str) -> Truth:
    if computed.accumulates:
        proof = replace(proof, transitions=proof.transitions[: len(computed.transitions)])
    certified = not proof.undecided
    proven = len(proof.transitions)
    for index, (ours, theirs) in enumerate(zip(computed.transitions, proof.transitions, strict=False)):
        if fault := difference(ours, theirs):
            raise TruthError(f"{where}, transition {index}: heyoka and the proof differ: {fault}")
    if certified and not computed.undecided and proof.status != computed.status:
        ends = [f"{route.status}{f' ({route.reason})' if route.reason else ''}" for route in (computed, proof)]
        raise TruthError(f"{where}: heyoka ends with {ends[0]}, the proof with {ends[1]}")
    if proven > len(computed.transitions) and not computed.undecided:
        raise TruthError(f"{where}: {proven} transitions are proven, heyoka found {len(computed.transitions)} only")
    if certified and proven < len(computed.transitions):
        raise TruthError(
            f"{where}: {proven} transitions are proven to be all, heyoka found {len(computed.transitions)}"
        )
    leading = proof if certified or proven > len(computed.transitions) else computed
    routes = (proof, computed) if proven or certified else (computed, proof)
    transitions = proof.transitions + computed.transitions[proven:]
    return replace(
        _truth(case, reading, leading, routes, transitions, proof.undecided), near_grazes=computed.near_grazes
    )


def _truth(
    case: str,
    reading: Reading,
    leading: Route,
    routes: Sequence[Route],
    transitions: tuple[ReferenceTransition, ...],
    undecided: str,
) -> Truth:
    """Truth with the end of its leading route; ``undecided`` is the reason why the proof stopped early."""
    return Truth(
        case=case,
        reading=reading.name,
        mathematics_hash=reading.mathematics_hash,
        status=leading.status,
        reason=leading.reason,
        end_digits=leading.end_digits,
        end_radius=leading.end_radius,
        transitions=transitions,
        near_grazes=(),
        methods=tuple((route.method, route.bits, route.seconds) for route in routes),
        certified=not undecided,
        uncertified_because=undecided,
    )


def heyoka_installed() -> bool:
    """Check whether heyoka, which the multiprecision route requires, is installed."""
    return find_spec("heyoka") is not None


def difference(a: ReferenceTransition, b: ReferenceTransition) -> str:
    """Describe how two results for one transition contradict each other; empty if they agree."""
    for name in ("kind", "surface", "from_mode", "to_mode"):
        if getattr(a, name) != getattr(b, name):
            return f"{name} {getattr(a, name)} and {getattr(b, name)} at t = {a.time_digits[:19]}"
    if far := _separation(a.time_digits, a.radius, b.time_digits, b.radius):
        return f"times {far} s apart, radii {a.radius:g} and {b.radius:g}, at t = {a.time_digits[:19]}"
    for mine, other in zip(a.state, b.state, strict=True):
        if far := _separation(mine, a.state_radius, other, b.state_radius):
            return f"states {far} apart, radii {a.state_radius:g} and {b.state_radius:g}, at t = {a.time_digits[:19]}"
    return ""


def _separation(a: str, radius_a: float, b: str, radius_b: float) -> str:
    """Distance of two numbers if the intervals of their radii are disjoint, else an empty text."""
    with localcontext() as context:
        context.prec = 1000
        distance = abs(Decimal(a) - Decimal(b))
        return f"{distance:.3g}" if distance > Decimal(radius_a) + Decimal(radius_b) else ""


def differences(stored: Truth, fresh: Truth) -> list[str]:
    """List the contradictions between a stored and a recomputed truth; how far each is proven does not matter."""
    found = []
    for name in ("mathematics_hash", "status"):
        if getattr(stored, name) != getattr(fresh, name):
            found.append(f"{name}: stored {getattr(stored, name)}, now {getattr(fresh, name)}")
    if len(stored.transitions) != len(fresh.transitions):
        found.append(f"transitions: stored {len(stored.transitions)}, now {len(fresh.transitions)}")
    if far := _separation(stored.end_digits, stored.end_radius, fresh.end_digits, fresh.end_radius):
        found.append(f"end: {far} s apart")
    for index, (old, new) in enumerate(zip(stored.transitions, fresh.transitions, strict=False)):
        if fault := difference(old, new):
            found.append(f"transition {index}: {fault}")
    return found
