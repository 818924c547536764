"""A hang, a crash, an exceeded memory limit or an invalid message is one failed job; the other jobs continue."""

from __future__ import annotations

import mmap
import sys
import time
from pathlib import Path

import pytest
from jobs import Act, Collector, Stuck, crowd, memory, noted, run
from processes import gone, wait_until

from henon_ref.errors import HenonRefError
from henon_ref.workers import pool
from henon_ref.workers.pool import WorkerPool

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="what processes hold and use is told by Linux's /proc")


class Pids(Collector):
    """Takes all results, in order."""

    def __init__(self) -> None:
        super().__init__()
        self.all: list[object] = []

    def take(self, what: str, result: object) -> None:
        super().take(what, result)
        self.all.append(result)


def workers_of(*sequences: list[str], queues: list[str] | None = None) -> list[object]:
    """Results of all jobs, one worker at a time."""
    seen = Pids()
    own = WorkerPool(workers=1, memory=memory())
    for queue, jobs in zip(queues or ["q"] * len(sequences), sequences, strict=True):
        own.add(queue, seen.jobs(*jobs))
    own.run()
    return seen.all


def test_sequences_of_one_queue_have_one_worker_after_the_other(monkeypatch):
    """Two queues: two workers. One that has grown does not go on."""
    a, b, c, d = workers_of(["pid"], ["pid"], ["pid"], ["pid"], queues=["x", "y", "x", "y"])
    assert a == b != c == d
    monkeypatch.setattr(pool, "MAX_REUSED_GROWTH", -1.0)
    assert len(set(workers_of(["pid"], ["pid"]))) == 2


def test_a_dead_worker_does_not_go_on():
    first, _, second, third = workers_of(["pid"], ["kill"], ["pid"], ["pid"])
    assert first != second == third


def test_free_workers_share_a_queue():
    seen = Pids()
    own = WorkerPool(workers=2, memory=memory())
    for _ in range(2):
        own.add("q", seen.jobs("pid", "wait", "pid"))
    own.run()
    assert len({pid for pid in seen.all if isinstance(pid, int)}) == 2


def test_what_a_job_keeps_the_next_one_finds():
    assert run(["keep", "kept"]).results["kept"] == "kept"


@pytest.mark.parametrize(
    ("what", "status", "words"),
    [
        ("kill", "failed", "SIGKILL"),
        ("abort", "failed", "SIGABRT: LLVM ERROR: out of registers"),
        ("abort_while_a_child_holds_the_way", "failed", "SIGABRT: the end"),
        ("raise", "failed", "ValueError: bad value"),
        ("trap", "failed", "the worker's reply cannot be read: RuntimeError: out of the pickle"),
        ("local", "failed", "local"),
        ("unsupported", "unsupported", "no events"),
        ("unavailable", "unavailable", "not installed"),
        ("stray", "failed", "the worker sent something that is no reply"),
        ("stray_done", "failed", "the worker sent something that is no reply"),
        ("large", "failed", "268435456 are allowed"),
        ("gulp", "failed", "memory"),
        ("eat", "failed", "memory"),
    ],
)
def test_a_failed_job_says_why_and_the_others_go_on(what, status, words):
    seen = run(["before", what, "after"], ["other"])
    assert (seen.failures[what].status, seen.failures[what].ignored) == (status, False)
    assert words in seen.failures[what].reason
    assert seen.results == {"before": "beforebefore", "after": "afterafter", "other": "otherother"}


@pytest.mark.parametrize("what", ["hang", "spin", "burn", "burn_in_a_child", "stray_part", "stop", "close", "print"])
def test_a_job_that_is_not_done_in_time_is_ended_from_outside(what, tmp_path):
    notes = tmp_path / "pids"
    seen = run(["before", Act(what, 0.3, str(notes)), "after"], ["other"])
    assert (seen.failures[what].status, seen.failures[what].ignored) == ("timeout", True)
    assert seen.results == {"before": "beforebefore", "after": "afterafter", "other": "otherother"}
    (worker,) = noted(notes)
    wait_until(lambda: gone(worker))


@pytest.mark.parametrize("what", ["sleep", "compile"])
def test_wall_time_within_reason_and_what_is_compiled_count_for_no_deadline(what):
    """They take half as long again as the deadline, of the one or the other."""
    assert not run([Act(what, 1.0)]).failures


@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="the system does not tell who waits")
def test_a_worker_that_waits_for_a_processor_is_not_late():
    """It takes a seventh of one, so that it is at it for four times its deadline."""
    with crowd():
        assert not run([Act("burn_in_a_crowd", 1.0)]).failures


def test_the_caller_s_own_work_is_no_worker_s_time():
    class Busy(Collector):
        def take(self, what, result):
            super().take(what, result)
            if what == "first":
                time.sleep(3.0)

    assert not run(["first"], [Act("answer_at_length", 0.7)], collector=Busy()).failures


@pytest.mark.parametrize(
    ("what", "result"), [("forge", "forgeforge"), ("flood", "floodflood"), ("fork_and_return", "mine")]
)
def test_what_another_process_than_the_worker_sends_is_nobody_s_answer(what, result):
    seen = run([what, "wait", "after"])
    assert seen.results == {what: result, "wait": "waitwait", "after": "afterafter"}
    assert not seen.failures


def test_an_answer_that_comes_late_is_not_the_next_job_s():
    seen = run(["late_thread", "wait", "after"])
    assert seen.results == {"late_thread": "late_thread" * 2, "wait": "waitwait", "after": "afterafter"}


def test_a_library_may_use_multiprocessing_and_print_much():
    assert run(["pool", "print_much"]).results == {"pool": 14, "print_much": "print_much" * 2}


def test_a_job_that_cannot_be_sent_is_named_whatever_its_classes_raise():
    with pytest.raises(HenonRefError, match=r"a job of 0 cannot be sent to its worker \(ValueError: no state\)"):
        run([Stuck()])


def test_memory_counts_wherever_it_is_held(tmp_path):
    """In a session of its own, by a process whose parent is gone."""
    notes = tmp_path / "pids"
    seen = run([Act("eat_elsewhere", 20.0, str(notes)), "after"])
    assert seen.failures["eat_elsewhere"].reason.startswith("memory: ")
    assert seen.results == {"after": "afterafter"}
    wait_until(lambda: all(map(gone, noted(notes))))


def test_what_the_caller_has_reserved_is_not_held_against_a_worker():
    """A worker that is forked from it begins with all its data, used or not."""
    reserved = mmap.mmap(-1, memory() + 2**30, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    try:
        assert run(["a", Act("hold", 5.0)]).results == {"a": "aa", "hold": 2**28}
    finally:
        reserved.close()


def test_what_a_worker_started_dies_with_it(tmp_path):
    notes = tmp_path / "pids"
    assert run([Act("children", 0.5, str(notes))]).failures["children"].status == "timeout"
    wait_until(lambda: all(map(gone, noted(notes))))


def test_what_a_worker_left_in_a_session_of_its_own_ends_with_the_run(tmp_path):
    notes = tmp_path / "pids"
    assert not run([Act("leave_a_daemon", 20.0, str(notes))]).failures
    assert len(noted(notes)) == 2
    wait_until(lambda: all(map(gone, noted(notes))))


def test_an_interrupt_leaves_no_process_behind(tmp_path):
    class Interrupted(Collector):
        def take(self, what, result):
            raise KeyboardInterrupt

    notes = [tmp_path / "a", tmp_path / "b"]
    with pytest.raises(KeyboardInterrupt):
        run([Act("a", 20.0, str(notes[0]))], [Act("hang", 20.0, str(notes[1]))], collector=Interrupted())
    wait_until(lambda: all(gone(pid) for path in notes for pid in noted(path)))


def test_a_job_that_stops_or_kills_its_guard_is_nobody_else_s_trouble(tmp_path):
    """What it starts ends with the guard that it has stopped, too."""
    notes = tmp_path / "pids"
    daemon = Act("leave_a_daemon", 20.0, str(notes))
    seen = run(["keep", "stop_guard", "kept", daemon], ["kill_guard", "after"], ["other"])
    assert seen.results["kept"] == "kept"
    assert seen.results["stop_guard"] == "stop_guard" * 2
    assert {what: failure.reason for what, failure in seen.failures.items()} == {
        "kill_guard": "the library was ended by signal SIGKILL"
    }
    assert (seen.results["after"], seen.results["other"]) == ("afterafter", "otherother")
    assert all(map(gone, noted(notes)))
