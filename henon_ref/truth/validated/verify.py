"""Holding claimed transitions against a proof: agreed, refuted with what broke, or open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from flint import arb

from henon_ref.filippov.modes import Mode, mode_text
from henon_ref.filippov.problem import Problem
from henon_ref.precision import working_precision
from henon_ref.trajectory import Kind
from henon_ref.truth.validated.run import CertifiedRun, CertifiedTransition, certify

SHARPER = 8.0
"""The proof's radius is asked to be this much smaller than the claim's."""
SMALLEST_RADIUS = 1e-60
"""Asked of the proof where a claim has no radius (an exact time)."""


class Claim(Protocol):
    """What a claimed transition must tell; a stored reference transition does."""

    @property
    def kind(self) -> Kind: ...
    @property
    def surface(self) -> int: ...
    @property
    def from_mode(self) -> Mode: ...
    @property
    def to_mode(self) -> Mode: ...
    @property
    def time_digits(self) -> str: ...
    @property
    def radius(self) -> float: ...


@dataclass(frozen=True)
class Verdict:
    """What a proof says of claimed transitions."""

    status: Literal["agreed", "refuted", "open"]
    """``open``: nothing contradicts the claim, but the proof does not reach as far, or not as fine."""
    reason: str
    """What broke, or what is open; empty where the claim is agreed."""
    index: int | None = None
    """The first transition it is about."""


def verify(problem: Problem, claims: Sequence[Claim], *, deadline: float | None = None) -> Verdict:
    """Prove the problem's transitions anew and hold a claim against them.

    Parameters
    ----------
    problem : Problem
    claims : sequence of Claim
        All transitions claimed up to the horizon, in order.
    deadline : float, optional
        Seconds for the proof.
    """
    finest = min((c.radius for c in claims if c.radius > 0), default=SMALLEST_RADIUS)
    run = certify(problem, radius=finest / SHARPER, deadline=deadline)
    return hold_against(run, claims, problem.system.sign_names)


def hold_against(run: CertifiedRun, claims: Sequence[Claim], names: Sequence[str]) -> Verdict:
    """Compare claims with a proof that is there already.

    Parameters
    ----------
    run : CertifiedRun
    claims : sequence of Claim
    names : sequence of str
        Names of the sign symbols, for the reasons.
    """
    with working_precision(2 * run.bits):
        for index in range(len(claims)):
            if index >= len(run.transitions):
                return _unproven(run, claims, index, names)
            verdict = _compare(run.transitions, claims, index, names)
            if verdict is not None:
                return verdict
    extra = run.transitions[len(claims) :]
    if extra:
        missing = _describe(extra[0], names)
        return Verdict("refuted", f"the claim ends after {len(claims)} transitions, but {missing} follows", len(claims))
    if run.status != "certified":
        return Verdict("open", f"no proof beyond t = {run.time.str(12, radius=False)}: {run.reason}", len(claims))
    return Verdict("agreed", "")


def _unproven(run: CertifiedRun, claims: Sequence[Claim], index: int, names: Sequence[str]) -> Verdict:
    claimed = _claimed(claims[index], names)
    if run.status == "certified":
        return Verdict("refuted", f"{claimed} is claimed as transition {index}, but there are only {index}", index)
    return Verdict("open", f"no proof beyond t = {run.time.str(12, radius=False)}: {run.reason}", index)


def _compare(
    proven: Sequence[CertifiedTransition], claims: Sequence[Claim], index: int, names: Sequence[str]
) -> Verdict | None:
    """What is wrong with one claim, if anything."""
    found, claim = proven[index], claims[index]
    following = proven[index + 1] if index + 1 < len(proven) else None
    after = claims[index + 1] if index + 1 < len(claims) else None
    if not _meets(found, claim) and following is not None and _meets(following, claim):
        swapped = after is not None and _meets(found, after)
        what = "is swapped with the next" if swapped else f"is missing: {_describe(found, names)}"
    elif _same(found, claim):
        return _compare_times(found, claim, index, names)
    elif after is not None and _meets(found, after):
        what = f"does not happen: {_claimed(claim, names)} is claimed, next is {_describe(found, names)}"
    else:
        what = f"is {_describe(found, names)}, not {_claimed(claim, names)}"
    return Verdict("refuted", f"transition {index} {what}", index)


def _compare_times(found: CertifiedTransition, claim: Claim, index: int, names: Sequence[str]) -> Verdict | None:
    apart = abs(arb(claim.time_digits) - found.time)
    if apart <= claim.radius:
        return None
    where = f"transition {index}, {_describe(found, names)}: the claimed time {claim.time_digits[:24]}"
    if not apart > claim.radius:
        proof = float(found.time.rad())
        return Verdict(
            "open", f"{where} cannot be told to hold to {claim.radius:.3g} s by a proof to {proof:.3g} s", index
        )
    by = apart.mid().str(3, radius=False)
    return Verdict("refuted", f"{where} is off by {by} s, which is more than its radius {claim.radius:.3g}", index)


def _same(found: CertifiedTransition, claim: Claim) -> bool:
    return (found.kind, found.surface, found.from_mode, found.to_mode) == (
        claim.kind,
        claim.surface,
        tuple(claim.from_mode),
        tuple(claim.to_mode),
    )


def _meets(found: CertifiedTransition, claim: Claim) -> bool:
    """Same change of mode at a time that fits within the claim's radius."""
    return _same(found, claim) and not abs(arb(claim.time_digits) - found.time) > claim.radius


def _describe(t: CertifiedTransition, names: Sequence[str]) -> str:
    return f"{_change(t, names)} at t = {t.time.str(17, radius=False)}"


def _claimed(t: Claim, names: Sequence[str]) -> str:
    return f"{_change(t, names)} at t = {t.time_digits[:18]}"


def _change(t: CertifiedTransition | Claim, names: Sequence[str]) -> str:
    return f"{t.kind} of {names[t.surface]} ({mode_text(t.from_mode, names)} -> {mode_text(t.to_mode, names)})"
