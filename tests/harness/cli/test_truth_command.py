"""``henon-ref truth``: stored truths, their check, and its errors."""

from __future__ import annotations

import csv
import json
import signal
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from problems import LEAVING_SLIDE as TEXT

from henon_ref.casefile.case import load_case
from henon_ref.harness.cli import compare as compare_command
from henon_ref.harness.cli.stored import truth_command as command
from henon_ref.harness.truth import compute, store
from henon_ref.harness.truth.reference import Truth

Run = Callable[..., tuple[int, str]]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "cases" / "leaving_slide.yaml"
    path.parent.mkdir()
    path.write_text(TEXT)
    return path


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """The command: exit status, and everything that it says."""

    def run(*arguments: str | Path) -> tuple[int, str]:
        status = command([str(a) for a in arguments])
        return status, "".join(capsys.readouterr())

    return run


def test_store_check_and_notice_a_moved_time(run: Run, file: Path) -> None:
    stored = file.parent / "truth" / "leaving_slide" / "default.json"
    code, text = run(file, "--dry-run")
    assert code == 1
    assert "not stored" in text
    assert not stored.exists()

    code, text = run(file.parent)
    assert code == 0
    assert "certified" in text
    before = stored.read_text()
    assert run(file)[0] == 0
    assert stored.read_text() == before
    assert run(file, "--dry-run")[0] == 0
    assert run(file, "--missing") == (0, "")

    radii = 10 * 1e-80
    assert radii < 1e-78
    zeros = "1." + "0" * 78
    assert zeros in before
    stored.write_text(before.replace(zeros, "1." + "0" * 77 + "1"))
    code, text = run(file, "--dry-run")
    assert code == 1
    assert "transition 0: times 1.00e-78 s apart" in text


def test_a_bad_case_is_one_message_and_exit_2(run: Run, file: Path) -> None:
    file.write_text(TEXT.replace("until: 3", "until: -3"))
    code, text = run(file)
    assert code == 2
    assert "leaving_slide.yaml:" in text
    assert not (file.parent / "truth").exists()


def test_a_contradiction_stores_nothing_and_exits_1(run: Run, file: Path) -> None:
    file.write_text(TEXT.replace('["1"]', '["1 + 10^(-35)"]'))
    code, text = run(file)
    assert code == 1
    assert "closed form" in text
    assert not (file.parent / "truth").exists()


def test_a_certified_truth_is_not_given_up_for_one_that_is_not(run: Run, file: Path) -> None:
    pytest.importorskip("heyoka")
    stored = file.parent / "truth" / "leaving_slide" / "default.json"
    assert run(file)[0] == 0
    before = stored.read_text()
    code, text = run(file, "--proof-seconds", "0")
    assert code == 0
    assert "not certified: " in text
    assert "agrees with the stored truth; the stored truth is certified and is kept" in text
    assert stored.read_text() == before
    assert run(file, "--proof-seconds", "0", "--dry-run")[0] == 1

    zeros = "1." + "0" * 78
    moved = before.replace(zeros, "1." + "0" * 10 + "1" + "0" * 67)
    stored.write_text(moved)
    code, text = run(file, "--proof-seconds", "0")
    assert code == 1
    assert "differs from the stored truth: transition 0" in text
    assert stored.read_text() == moved


def test_a_proof_makes_an_uncertified_truth_a_certified_one(run: Run, file: Path) -> None:
    pytest.importorskip("heyoka")
    assert "stored" in run(file, "--proof-seconds", "0")[1]
    code, text = run(file)
    assert code == 0
    assert "certified" in text
    assert "more is proven now" in text
    assert run(file, "--dry-run")[0] == 0


@pytest.mark.parametrize("seconds", ["-1", "nan"])
def test_a_time_for_proofs_that_is_none_is_refused(run: Run, file: Path, seconds: str) -> None:
    code, text = run(file, "--proof-seconds", seconds)
    assert code == 2
    assert f"--proof-seconds is a number of seconds from 0 on, not {seconds}" in text
    assert not (file.parent / "truth").exists()


def test_a_truth_that_cannot_be_stored_is_one_message_and_exit_1(run: Run, file: Path) -> None:
    (file.parent / "truth" / "leaving_slide" / "default.json").mkdir(parents=True)
    code, text = run(file)
    assert code == 1
    assert f"cannot be stored in {file.parent / 'truth'}: " in text
    assert list((file.parent / "truth" / "leaving_slide").iterdir()) == [
        file.parent / "truth" / "leaving_slide" / "default.json"
    ]


def test_case_files_are_found_as_compare_finds_them(run: Run, file: Path) -> None:
    file.rename(file.with_suffix(".yml"))
    code, text = run(file.parent, "--dry-run")
    assert (code, "leaving_slide, default" in text) == (1, True)

    (file.parent / "again.yaml").write_text(TEXT)
    code, text = run(file.parent)
    assert code == 2
    assert "leaving_slide.yml: the name 'leaving_slide' is also that of" in text
    assert not (file.parent / "truth").exists()

    empty = file.parent.parent / "empty"
    empty.mkdir()
    code, text = run(empty)
    assert code == 2
    assert "empty: no case file" in text


def dropped(text: str) -> str:
    found = json.loads(text)
    found["transitions"].pop()
    return json.dumps(found, indent=1)


Compared = tuple[str, dict[str, str], dict[str, Any]]


@pytest.fixture
def compare(
    file: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> Iterator[Callable[[], Compared]]:
    """The command of comparisons on the file; the user's cache is beside it, for its workers, too."""
    cache = file.parent.parent / "cache"
    monkeypatch.setattr(store, "user_folder", lambda: cache / "henon_ref" / "truth")
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))  # of workers that are no forks
    handler = signal.getsignal(signal.SIGTERM)

    def compare() -> Compared:
        """What it tells of truths, its one row, the report's words on the truth."""
        place = file.parent.parent / "out"
        words = [str(file), "--solvers", "scipy-dop853", "--tolerances", "1e-9", "--repeats", "1", "--no-figures"]
        caplog.clear()
        compute._tell_once.cache_clear()  # as in a process of its own
        assert compare_command.command([*words, "--out", str(place)]) == 0
        with (place / "leaving_slide" / "runs.csv").open() as csv_file:
            (row,) = csv.DictReader(csv_file)
        manifest = json.loads((place / "leaving_slide" / "manifest.json").read_text())
        return "\n".join(caplog.messages), row, manifest["readings"]["default"]["truth"]

    yield compare
    signal.signal(signal.SIGTERM, handler)


@pytest.mark.slow  # 11 s of processes; daily: harness/truth/test_truth_store.py, and the next test by the same command
def test_nobody_is_scored_against_a_changed_truth(run: Run, file: Path, compare: Callable[[], Compared]) -> None:
    """By one of the changes that truth/test_truth_store.py has."""
    stored = file.parent / "truth" / "leaving_slide" / "default.json"
    assert run(file, "--proof-seconds", "0")[0] == 0
    changed = dropped(stored.read_text())
    assert changed != stored.read_text()
    stored.write_text(changed)
    for _ in range(2):  # computed anew, then read where that was kept
        told, row, truth = compare()
        (line,) = told.splitlines()
        assert line.startswith(f"{stored} is no stored truth (")
        assert (row["reference_transitions"], row["matched"], row["verdict"]) == ("1", "1", "right")
        assert float(row["max_time_error_s"]) < 1e-6
        assert truth["certified"]
        assert stored.read_text() == changed
        (kept,) = file.parent.parent.glob("cache/**/truth/leaving_slide/default.json")
    first = kept.stat().st_mtime_ns
    code, text = run(file, "--dry-run")
    assert code == 1
    assert str(stored) in text
    assert stored.read_text() == changed
    assert run(file)[0] == 0
    assert compare()[0] == ""
    assert kept.stat().st_mtime_ns == first


def test_a_truth_of_what_the_case_said_before_is_told_and_stays(
    run: Run, file: Path, compare: Callable[[], Compared]
) -> None:
    stored = file.parent / "truth" / "leaving_slide" / "default.json"
    assert run(file)[0] == 0
    before = stored.read_text()
    file.write_text(TEXT.replace("until: 3", "until: 2"))
    told, row, _ = compare()
    assert told.startswith(f"{stored} is the truth of what the case said before; ")
    assert "\n" not in told
    assert (row["end_time_s"], row["verdict"]) == ("2.0", "right")
    assert stored.read_text() == before


@pytest.fixture
def computed(file: Path, monkeypatch: pytest.MonkeyPatch) -> Truth:
    """The truth, in place of whatever would be computed; the user's cache is in the same folder."""
    monkeypatch.setattr(store, "user_folder", lambda: file.parent.parent / "cache" / "henon_ref" / "truth")
    case = load_case(file)
    truth = compute.compute(case, case.readings[0])
    monkeypatch.setattr(compute, "compute", lambda *a, **k: truth)
    return truth


def test_a_damaged_truth_in_the_user_s_cache_is_told_and_replaced(
    file: Path, computed: Truth, caplog: pytest.LogCaptureFixture
) -> None:
    case = load_case(file.rename(file.parent.parent / "mine.yaml"))
    compute.truth_for(case, case.readings[0])
    (kept,) = file.parent.parent.glob("cache/**/default.json")
    assert stat.S_IMODE(kept.parents[2].stat().st_mode) == 0o700
    before = kept.read_text()
    kept.write_text(dropped(before))
    assert compute.truth_for(case, case.readings[0]) == computed
    assert [message.startswith(f"{kept} is no stored truth (") for message in caplog.messages] == [True]
    assert kept.read_text() == before


def test_where_nothing_can_be_stored_beside_the_cases_the_user_s_cache_takes_it(file: Path, computed: Truth) -> None:
    (file.parent / "truth").write_text("a file in its place")
    case = load_case(file)
    compute.truth_for(case, case.readings[0])
    assert len(list(file.parent.parent.glob("cache/**/truth/leaving_slide/default.json"))) == 1
