"""Stored truths: reading returns what was written, and equal truths have equal bytes."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

import pytest

from henon_ref.harness.truth import store
from henon_ref.harness.truth.reference import NearGraze, ReferenceTransition, Truth, TruthError, instants

TRANSITION = ReferenceTransition(
    kind="crossing",
    surface=1,
    from_mode=(1, -1),
    to_mode=(1, 1),
    time_digits="0.33333333333333333333333333333333333333",
    radius=1.1e-38,
    state=("-1." + "5" * 64, "2e-20"),  # more digits than a new truth has: files from before stay valid
    state_radius=1e-38,
    transversality=4.7,
    conditioning=0.2128,
    proven=True,
)
TRUTH = Truth(
    case="somewhere",
    reading="default",
    mathematics_hash="abc",
    status="ok",
    reason="",
    end_digits="3.00",
    end_radius=1e-80,
    transitions=(TRANSITION, replace(TRANSITION, surface=0, conditioning=inf, proven=False)),
    near_grazes=(NearGraze(0.5, 0, 1e-9),),
    methods=(("ball arithmetic", (142,), 1.5), ("heyoka", (256, 224), 2.5)),
    certified=False,
    uncertified_because="a graze",
)


def test_what_is_stored_is_read_back(tmp_path: Path) -> None:
    store.save(tmp_path, TRUTH)
    assert store.load(tmp_path, "somewhere", "default") == TRUTH


def test_the_same_truth_is_the_same_bytes_and_valid_json(tmp_path: Path) -> None:
    first = store.save(tmp_path, TRUTH).read_bytes()
    assert store.save(tmp_path, TRUTH).read_bytes() == first
    found = json.loads(first, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert found["transitions"][1]["conditioning"] is None


def test_nothing_stored_is_none(tmp_path: Path) -> None:
    assert store.load(tmp_path, "somewhere", "default") is None


NO_TRUTHS = (
    "",
    "[]",
    '{"schema": 1}',
    '{"schema": 1, "case": 3, "transitions": "x"}',
    store.dumps(TRUTH).replace('"+1,-1 -> +1,+1"', "3"),
    "[" * 100_000,
    "\udcff",
)


@pytest.mark.parametrize("text", NO_TRUTHS, ids=range(len(NO_TRUTHS)))
def test_a_file_that_is_no_truth_is_refused_with_the_mend(tmp_path: Path, text: str) -> None:
    path = store.path_of(tmp_path, "somewhere", "default")
    path.parent.mkdir()
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(TruthError, match=r"default\.json.*delete it") as caught:
        store.load(tmp_path, "somewhere", "default")
    assert "\n" not in str(caught.value)


def test_a_folder_in_the_place_of_a_truth_is_refused_with_the_mend(tmp_path: Path) -> None:
    store.path_of(tmp_path, "somewhere", "default").mkdir(parents=True)
    with pytest.raises(TruthError, match=r"default\.json.*directory.*delete it"):
        store.load(tmp_path, "somewhere", "default")


def _changed(change: Callable[[dict[str, Any]], object]) -> Callable[[str], str]:
    """A change of what the file says; its checksum stays as it is."""

    def apply(text: str) -> str:
        found = json.loads(text)
        change(found)
        return json.dumps(found, indent=1) + "\n"

    return apply


CHANGES: dict[str, Callable[[str], str]] = {
    "a digit of a time": lambda text: text.replace("0.3333333333", "0.3333343333"),
    "a digit of a radius": lambda text: text.replace("1.1e-38", "1.2e-38"),
    "a digit of the form": lambda text: text.replace('"schema": 1', '"schema": 0'),
    "a digit of the checksum": lambda text: text[:-6] + ("0" if text[-6] != "0" else "1") + text[-5:],
    "another reason": lambda text: text.replace("a graze", "a touch"),
    "a blank": lambda text: text + " ",
    "the end cut off": lambda text: text[: len(text) // 2],
    "a transition dropped": _changed(lambda found: found["transitions"].pop()),
    "all transitions dropped": _changed(lambda found: found["transitions"].clear()),
    "certified by hand": _changed(lambda found: found.update(certified=True)),
    "a key dropped": _changed(lambda found: found.pop("near_grazes")),
    "the checksum dropped": _changed(lambda found: found.pop("checksum")),
    "a key too many": _changed(lambda found: found.update(note="mine")),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_changed_file_is_no_stored_truth(tmp_path: Path, change: Callable[[str], str]) -> None:
    path = store.save(tmp_path, TRUTH)
    before = path.read_text()
    path.write_text(change(before))
    assert path.read_text() != before
    with pytest.raises(TruthError, match=r"default\.json.*delete it"):
        store.load(tmp_path, "somewhere", "default")


def test_the_truth_of_another_reading_is_not_that_of_this_one(tmp_path: Path) -> None:
    path = store.save(tmp_path, TRUTH)
    path.rename(path.with_name("other.json"))
    with pytest.raises(TruthError, match=r"it is that of somewhere, default"):
        store.load(tmp_path, "somewhere", "other")


FAULTS: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "a number as text": (lambda t: t.update(end_radius="1e-80"), "end_radius"),
    "a time as a number": (lambda t: t["transitions"][0].update(time=0.3), "transitions.0.time"),
    "a time that is none": (lambda t: t["transitions"][0].update(time="soon"), "transitions.0.time"),
    "an unknown kind": (lambda t: t["transitions"][0].update(kind="slide"), "transitions.0.kind"),
    "an unknown mode": (lambda t: t["transitions"][0].update(modes="+1,-2 -> +1,+1"), "transitions.0.modes"),
    "modes too short": (lambda t: t["transitions"][0].update(modes="+1 -> +1"), "different lengths"),
    "a surface too many": (lambda t: t["transitions"][0].update(surface=2), "surface 2 of 2"),
    "a negative radius": (lambda t: t["transitions"][0].update(radius=-1e-9), "transitions.0.radius"),
    "a truth value as text": (lambda t: t.update(certified="false"), "certified"),
    "an unknown status": (lambda t: t.update(status="timeout"), "status"),
    "transitions out of order": (lambda t: t["transitions"][0].update(time="0.5"), "behind a later one"),
    "a mode that leads nowhere": (lambda t: t["transitions"][1].update(time="1", modes="-1,-1 -> -1,1"), "modes"),
    "a transition beyond the end": (lambda t: t.update(end_time="0.1"), "beyond the end"),
    "a proof too few": (lambda t: t.update(certified=True), "not every transition is proven"),
}


@pytest.mark.parametrize(("change", "words"), FAULTS.values(), ids=FAULTS)
def test_a_truth_of_wrong_types_or_that_contradicts_itself_is_refused(
    tmp_path: Path, change: Callable[[dict[str, Any]], object], words: str
) -> None:
    path = store.save(tmp_path, TRUTH)
    path.write_text(store._checked(_changed(change)(path.read_text())))
    assert path.read_text(), "a checksum that fits"
    with pytest.raises(TruthError, match=words):
        store.load(tmp_path, "somewhere", "default")


def test_a_failed_write_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = store.save(tmp_path, TRUTH)
    before = path.read_bytes()

    def full(*_: object) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OSError, match="no space"):
        store.save(tmp_path, replace(TRUTH, status="failed"))
    assert path.read_bytes() == before
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_truths_live_beside_the_cases_or_in_the_users_cache(tmp_path: Path) -> None:
    assert store.folder_of(tmp_path / "cases" / "hard" / "a.yaml") == tmp_path / "cases" / "truth"
    assert store.folder_of(tmp_path / "mine.yaml") == store.user_folder() != tmp_path


def test_transitions_of_one_instant_belong_together() -> None:
    later = replace(TRANSITION, time_digits="0.4")
    assert instants((*TRUTH.transitions, later)) == [range(0, 2), range(2, 3)]


def test_times_are_double_doubles() -> None:
    assert TRANSITION.time == 1 / 3
    assert TRANSITION.time_low == pytest.approx(1.850371707708594e-17)
