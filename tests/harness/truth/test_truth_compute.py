"""A truth from two routes and closed forms: stored if they agree; otherwise an error names the contradiction."""

from __future__ import annotations

import logging
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
import sympy as sp
from problems import LEAVING_SLIDE as TEXT

from henon_ref.casefile.case import Case, Reading, parse_case
from henon_ref.harness.truth import compute, store
from henon_ref.harness.truth.proofs import with_closed_forms
from henon_ref.harness.truth.reference import ReferenceTransition, Route, Truth, TruthError


def case(text: str = TEXT) -> Case:
    return parse_case(text)


def reading(text: str = TEXT) -> Reading:
    return case(text).readings[0]


def transition(time: str, *, radius: float = 1e-50, state: str = "0", proven: bool = False) -> ReferenceTransition:
    return ReferenceTransition("release", 0, (0,), (1,), time, radius, (state,), radius, proven=proven)


def route(*transitions: ReferenceTransition, undecided: str = "", **changes: object) -> Route:
    whole = Route("somehow", (100,), 1.0, "ok", "", "3", 1e-60, transitions, undecided=undecided)
    return replace(whole, **changes)  # type: ignore[arg-type]


def settled(computed: Route, proof: Route) -> Truth:
    return compute._combined("leaving_slide", reading(), computed, proof, "here")


def test_what_is_proven_takes_precedence() -> None:
    truth = settled(route(transition("1.0")), route(transition("1.00", radius=1e-30, proven=True)))
    assert truth.certified
    assert truth.transitions[0].radius == 1e-30
    assert truth.proven == 1


def test_where_the_proof_stops_the_computed_digits_go_on_and_the_reason_is_kept() -> None:
    computed = route(transition("1"), transition("2"))
    truth = settled(computed, route(transition("1", proven=True), undecided="a graze"))
    assert [t.proven for t in truth.transitions] == [True, False]
    assert not truth.certified
    assert truth.uncertified_because == "a graze"


@pytest.mark.parametrize(
    ("computed", "proof", "message"),
    [
        pytest.param(
            [transition("1." + "0" * 29 + "1")], [transition("1", radius=1e-31)], "times 1e-30 s apart", id="time"
        ),
        pytest.param([transition("1", state="0.1")], [transition("1")], "states 0.1.* apart", id="state"),
        pytest.param([transition("1")], [replace(transition("1"), to_mode=(-1,))], "to_mode", id="mode"),
        pytest.param([transition("1")], [replace(transition("1"), kind="crossing")], "kind", id="kind"),
        pytest.param([transition("1")], [], "0 transitions are proven to be all, heyoka found 1", id="one too many"),
        pytest.param([], [transition("1")], "1 transitions are proven, heyoka found 0", id="one missed"),
    ],
)
def test_routes_that_contradict_each_other_leave_no_truth(
    computed: Sequence[ReferenceTransition], proof: Sequence[ReferenceTransition], message: str
) -> None:
    with pytest.raises(TruthError, match=message):
        settled(route(*computed), route(*proof))


def test_routes_that_end_differently_leave_no_truth() -> None:
    with pytest.raises(TruthError, match="ends with nonunique, the proof with ok"):
        settled(route(status="nonunique"), route())


def test_a_proof_goes_on_where_the_computed_digits_stop() -> None:
    computed = route(transition("1"), undecided="too rough", status="failed")
    truth = settled(computed, route(transition("1", proven=True), transition("2", proven=True)))
    assert truth.certified
    assert truth.status == "ok"
    assert len(truth.transitions) == 2


def test_accumulating_transitions_are_listed_as_far_as_they_are_told_apart() -> None:
    computed = route(transition("1"), accumulates=True, status="failed", reason="transitions accumulate")
    proof = route(transition("1", proven=True), transition("1.5", proven=True), undecided="too short")
    truth = settled(computed, proof)
    assert len(truth.transitions) == 1
    assert truth.status == "failed"


def test_closed_forms_replace_what_they_agree_with() -> None:
    (found,) = with_closed_forms([transition("3.14159", radius=1e-5)], [sp.pi])
    assert found.closed_form
    assert found.radius == 1e-80
    assert found.time_digits.startswith("3.14159265358979323846264338327950288419716939937510582097494459230781640628")


def test_closed_forms_that_do_not_agree_are_refused() -> None:
    with pytest.raises(TruthError, match=r"transition 0: the closed form gives 3\.1415926535.*computed is 3\.14159 "):
        with_closed_forms([transition("3.14159", radius=1e-7)], [sp.pi])


def test_more_closed_forms_than_transitions_are_refused() -> None:
    with pytest.raises(TruthError, match="2 exact transition times, but only 1"):
        with_closed_forms([transition("1")], [sp.Integer(1), sp.Integer(2)])


def test_exact_modes_have_to_agree() -> None:
    assert with_closed_forms([transition("1")], [], [(1,)])
    with pytest.raises(TruthError, match=r"exact mode after it is \(-1,\)"):
        with_closed_forms([transition("1")], [], [(-1,)])


def test_computed_stored_and_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    truth = compute.truth_for(case(), reading(), folder=tmp_path)
    assert truth.certified
    assert truth.status == "ok"
    assert [t.closed_form for t in truth.transitions] == [True]
    assert truth.transitions[0].conditioning == 0.0
    monkeypatch.setattr(compute, "compute", lambda *a, **k: pytest.fail("computed, although it is stored"))
    assert compute.truth_for(case(), reading(), folder=tmp_path) == replace(
        truth, methods=tuple((m, b, round(s, 1)) for m, b, s in truth.methods)
    )


def test_other_mathematics_is_computed_anew(tmp_path: Path) -> None:
    stored = compute.compute(case(), reading())
    store.save(tmp_path, stored)
    other = TEXT.replace("until: 3", "until: 2")
    assert compute.stored_truth(case(), reading(), tmp_path) is not None
    assert compute.stored_truth(case(other), reading(other), tmp_path) is None


@pytest.mark.parametrize(
    "claims",
    [
        "",
        'exact: {transition_times: ["1 + 1e-70"]}\n',
        'exact: {transition_times: ["1"], modes: [[-1]]}\n',
        'exact: {transition_times: ["1"]}\nexpect: {status: diverged}\n',
    ],
)
def test_a_truth_that_was_not_held_against_what_the_case_claims_is_computed_anew(tmp_path: Path, claims: str) -> None:
    store.save(tmp_path, compute.compute(case(), reading()))
    other = TEXT[: TEXT.index("exact")] + claims
    assert reading(other).mathematics_hash == reading().mathematics_hash
    assert compute.stored_truth(case(other), reading(other), tmp_path) is None


def test_a_folder_that_cannot_be_written_costs_a_warning_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    made = compute.compute(case(), reading())
    monkeypatch.setattr(compute, "compute", lambda *a, **k: made)
    file = tmp_path / "file"
    file.write_text("")
    with caplog.at_level(logging.WARNING):
        assert compute.truth_for(case(), reading(), folder=file) is made
    assert "is not kept" in caplog.text


def test_an_end_that_the_case_does_not_expect_is_refused() -> None:
    text = TEXT + "expect: {status: diverged, reason: it does not}\n"
    with pytest.raises(TruthError, match="expects status diverged, computed is ok"):
        compute.compute(case(text), reading(text))


def test_differences_name_what_changed() -> None:
    old = settled(route(transition("1")), route(transition("1", proven=True)))
    assert compute.differences(old, old) == []
    moved = replace(old, transitions=(transition("1.1"),))
    assert "transition 0: times 0.1" in compute.differences(moved, old)[0]
    assert compute.differences(replace(old, transitions=()), old) == ["transitions: stored 0, now 1"]
    assert "status" in compute.differences(replace(old, status="failed"), old)[0]


def test_a_proof_gets_little_time_where_there_is_no_transition_to_prove(monkeypatch, tmp_path: Path) -> None:
    """A run that fails before its first transition: a proof could only go after it to the singularity."""
    pytest.importorskip("heyoka")
    asked: list[float | None] = []

    def proof(_: object, *, seconds: float | None, progress: object) -> Route:
        asked.append(seconds)
        return route(undecided="the deadline passed")

    monkeypatch.setattr("henon_ref.harness.truth.proofs.prove", proof)
    monkeypatch.setattr("henon_ref.harness.truth.conditioning.conditioning", lambda *_: [])
    text = TEXT.replace('exact: {transition_times: ["1"]}\n', "")
    for name, found in (("failed", route(undecided="singular", status="failed")), ("whole", route())):
        monkeypatch.setattr(
            "henon_ref.harness.truth.multiprecision.route.multiprecision", lambda *_, found=found, **__: found
        )
        compute.truth_for(case(text), reading(text), folder=tmp_path / name)
    assert asked == [compute.BARREN_SECONDS, compute.PROOF_SECONDS]


@pytest.fixture
def no_heyoka(monkeypatch: pytest.MonkeyPatch) -> None:
    """An environment without heyoka."""
    for module in [name for name in sys.modules if name.split(".")[0] == "heyoka"]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "heyoka", None)


@pytest.mark.usefixtures("no_heyoka")
def test_without_heyoka_a_proof_stands_alone_and_says_so(tmp_path: Path) -> None:
    truth = compute.truth_for(case(), reading(), folder=tmp_path)
    assert truth.certified
    assert [(t.time, t.proven, t.closed_form, t.conditioning) for t in truth.transitions] == [(1.0, True, True, 0.0)]
    ((method, _, _),) = truth.methods
    assert method.startswith("ball arithmetic, python-flint")
    assert method.endswith("(alone: heyoka is not installed)")
    assert store.load(tmp_path, "leaving_slide", "default") is not None


@pytest.mark.usefixtures("no_heyoka")
def test_without_heyoka_a_truth_goes_as_far_as_the_proof_and_is_not_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stopped = route(transition("1", proven=True), status="failed", reason="a graze", undecided="a graze")
    monkeypatch.setattr("henon_ref.harness.truth.proofs.prove", lambda *a, **k: stopped)
    truth = compute.truth_for(case(), reading(), folder=tmp_path)
    assert (truth.status, truth.certified, truth.uncertified_because) == ("failed", False, "a graze")
    assert len(truth.transitions) == 1
    assert not list(tmp_path.iterdir())


def test_nothing_is_written_into_an_installed_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "site-packages" / "henon_ref"
    file = package / "cases" / "leaving_slide.yaml"
    file.parent.mkdir(parents=True)
    file.write_text(TEXT)
    monkeypatch.setattr(store, "_PACKAGE", package)
    monkeypatch.setattr(store, "user_folder", lambda: tmp_path / "user")
    shipped = replace(case(), path=file)
    truth = compute.truth_for(shipped, reading())
    assert [p.name for p in package.rglob("*")] == ["cases", "leaving_slide.yaml"]
    assert store.load(tmp_path / "user", "leaving_slide", "default") is not None
    assert store.folder_for_new(file) == tmp_path / "user"
    store.save(package / "cases" / "truth", truth)  # as a wheel has it
    monkeypatch.setattr(compute, "compute", lambda *a, **k: pytest.fail("computed, although it is stored"))
    assert compute.truth_for(shipped, reading()).transitions == truth.transitions
