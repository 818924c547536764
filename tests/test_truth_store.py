"""Stored truths: what is written is what is read, and the same truth is the same bytes."""

from __future__ import annotations

import json
from dataclasses import replace
from math import inf
from pathlib import Path

import pytest

from henon_ref.truth import store
from henon_ref.truth.reference import NearGraze, ReferenceTransition, Truth, TruthError, instants

TRANSITION = ReferenceTransition(
    kind="crossing",
    surface=1,
    from_mode=(1, -1),
    to_mode=(1, 1),
    time_digits="0.33333333333333333333333333333333333333",
    radius=1.1e-38,
    state=("-1.5", "2e-20"),
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


def test_an_older_form_counts_as_not_stored(tmp_path: Path) -> None:
    path = store.save(tmp_path, TRUTH)
    path.write_text(path.read_text().replace('"schema": 1', '"schema": 0'))
    assert store.load(tmp_path, "somewhere", "default") is None


def test_a_failed_write_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = store.save(tmp_path, TRUTH)
    before = path.read_bytes()

    def full(*_: object) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr(store.os, "replace", full)
    with pytest.raises(OSError, match="no space"):
        store.save(tmp_path, replace(TRUTH, status="failed"))
    assert path.read_bytes() == before
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_truths_live_beside_the_cases_or_in_the_users_cache(tmp_path: Path) -> None:
    assert store.folder_of(tmp_path / "cases" / "hard" / "a.yaml") == tmp_path / "cases" / "truth"
    assert "henon_ref" in str(store.folder_of(tmp_path / "mine.yaml"))
    assert tmp_path not in store.folder_of(tmp_path / "mine.yaml").parents


def test_transitions_of_one_instant_belong_together() -> None:
    later = replace(TRANSITION, time_digits="0.4")
    assert instants((*TRUTH.transitions, later)) == [range(0, 2), range(2, 3)]


def test_times_are_double_doubles() -> None:
    assert TRANSITION.time == 1 / 3
    assert TRANSITION.time_low == pytest.approx(1.850371707708594e-17)
