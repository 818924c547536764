"""The certificate can fail: each kind of wrong claim is refused, with what broke."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest
import systems

from henon_ref.filippov.modes import Mode
from henon_ref.trajectory import Kind
from henon_ref.truth.validated import CertifiedRun, certify, hold_against, verify


@dataclass(frozen=True)
class Claimed:
    kind: Kind
    surface: int
    from_mode: Mode
    to_mode: Mode
    time_digits: str
    radius: float


@pytest.fixture(scope="module")
def run() -> CertifiedRun:
    return certify(systems.free_coulomb(), radius=1e-30)


@pytest.fixture
def claims(run: CertifiedRun) -> list[Claimed]:
    """What a store would hold: digits rounded at a radius of 1e-28."""
    return [
        Claimed(t.kind, t.surface, t.from_mode, t.to_mode, t.time.str(30, radius=False), 1e-28) for t in run.transitions
    ]


def test_true_claims_are_agreed(claims: list[Claimed]) -> None:
    verdict = verify(systems.free_coulomb(), claims)
    assert (verdict.status, verdict.reason) == ("agreed", "")


def test_time_moved_by_ten_radii(claims: list[Claimed]) -> None:
    claims[2] = replace(
        claims[2], time_digits="9.424777960769379715387930150838"
    )  # 3 pi + 1e-27, the digits cut at 1e-30
    verdict = verify(systems.free_coulomb(), claims)
    assert (verdict.status, verdict.index) == ("refuted", 2)
    assert "off by 9.99e-28" in verdict.reason
    assert "more than its radius 1e-28" in verdict.reason


def test_dropped_event(run: CertifiedRun, claims: list[Claimed]) -> None:
    inner = hold_against(run, claims[:1] + claims[2:], ["s"])
    assert (inner.status, inner.index) == ("refuted", 1)
    assert "is missing: crossing of s (s=+1 -> s=-1) at t = 6.28" in inner.reason
    last = hold_against(run, claims[:-1], ["s"])
    assert last.status == "refuted"
    assert "ends after 3 transitions, but stick of s" in last.reason


def test_event_too_many(run: CertifiedRun, claims: list[Claimed]) -> None:
    ghost = Claimed("release", 0, (0,), (1,), "15.0", 1e-28)
    after = hold_against(run, [*claims, ghost], ["s"])
    assert after.status == "refuted"
    assert "there are only 4" in after.reason
    between = hold_against(run, [*claims[:1], ghost, *claims[1:]], ["s"])
    assert (between.status, between.index) == ("refuted", 1)
    assert "does not happen" in between.reason


def test_two_swapped(run: CertifiedRun, claims: list[Claimed]) -> None:
    claims[1], claims[2] = claims[2], claims[1]
    verdict = hold_against(run, claims, ["s"])
    assert (verdict.status, verdict.index) == ("refuted", 1)
    assert "swapped" in verdict.reason


def test_wrong_mode(run: CertifiedRun, claims: list[Claimed]) -> None:
    claims[3] = replace(claims[3], kind="crossing", to_mode=(-1,))
    verdict = hold_against(run, claims, ["s"])
    assert (verdict.status, verdict.index) == ("refuted", 3)
    assert "is stick of s" in verdict.reason


def test_wrong_sign_in_one_term(claims: list[Claimed]) -> None:
    """x'' = -x + F sgn x' in place of -x - F sgn x': the same turns at first, and no stick."""
    good = systems.free_coulomb()
    position, friction = good.system.field[1].as_ordered_terms()
    for flipped in ((good.system.field[0], -position + friction), (good.system.field[0], position - friction)):
        wrong = replace(good, system=replace(good.system, field=flipped))
        verdict = verify(wrong, claims)
        assert verdict.status == "refuted"
        assert verdict.reason.startswith("transition") or "there are only" in verdict.reason


def test_stick_for_kinetic_alone_is_refused() -> None:
    """One sign in Fig. 8's spring (the paper has both) moves the first transition."""
    right = systems.fig8("equations", "1")
    proof = certify(right, radius=1e-20)
    held = [
        Claimed(t.kind, t.surface, t.from_mode, t.to_mode, t.time.str(19, radius=False), 1e-17)
        for t in proof.transitions
    ]
    assert verify(right, held).status == "agreed"
    spring = right.system.field[1]
    cube = next(e for e in spring.atoms(type(systems.X1**2)) if e.exp == 3)
    wrong = replace(right, system=replace(right.system, field=(right.system.field[0], spring.xreplace({cube: -cube}))))
    verdict = verify(wrong, held)
    assert verdict.status == "refuted"
    assert verdict.index == 0


def test_claim_beyond_the_proof_stays_open() -> None:
    short = certify(systems.free_coulomb(), radius=1e-30, max_transitions=2)
    claims = [
        Claimed(t.kind, t.surface, t.from_mode, t.to_mode, t.time.str(30, radius=False), 1e-28)
        for t in certify(systems.free_coulomb(), radius=1e-30).transitions
    ]
    verdict = hold_against(short, claims, ["s"])
    assert (verdict.status, verdict.index) == ("open", 2)


def test_proof_coarser_than_the_claim_stays_open(claims: list[Claimed]) -> None:
    coarse = certify(systems.free_coulomb(), radius=1e-10, bits=60)
    verdict = hold_against(coarse, claims, ["s"])
    assert verdict.status == "open"
    assert "cannot be told" in verdict.reason
