"""A hang, a crash, memory beyond the limit or an exception is one failed job; the others go on."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import textwrap
import time
from collections import deque
from pathlib import Path

import pytest
from jobs import Act, Collector, Stuck, memory, run

from henon_ref.errors import HenonRefError
from henon_ref.score import fence, process
from henon_ref.score.fence import Fence, Lane

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals")

NURSERY = "from henon_ref.score.nursery import begin_nursery; begin_nursery()"


def gone(pid: int) -> bool:
    """Whether a process is no more (or is only waiting to be reaped by somebody else)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except FileNotFoundError:
        return True


def test_lanes_of_one_kin_have_one_worker_after_the_other(monkeypatch):
    """Four lanes of two kins, one at a time, and two of none: four workers. A grown one is not passed on."""

    def workers() -> list[int]:
        seen = Collector()
        kins = {"a": "x", "b": "y", "c": "x", "d": "y", "e": None, "f": None}
        lanes = [Lane(what, deque([Act(what)]), kin) for what, kin in kins.items()]
        Fence(processes=1, memory=memory()).run(lanes, seen)
        assert set(seen.results) == set(kins)
        return [seen.pids[what] for what in kins]

    a, b, c, d, e, f = workers()
    assert (a, b) == (c, d)
    assert len({a, b, e, f}) == 4
    monkeypatch.setattr(fence, "PASSED_ON", -1.0)
    assert len(set(workers())) == 6


def test_a_dead_worker_is_not_passed_on():
    seen = Collector()
    lanes = [Lane(what, deque([Act(what)]), "x") for what in ("a", "kill", "b", "c")]
    Fence(processes=1, memory=memory()).run(lanes, seen)
    assert set(seen.results) == {"a", "b", "c"}
    assert set(seen.failures) == {"kill"}
    assert seen.pids["a"] != seen.pids["b"] == seen.pids["c"]


def test_a_lane_keeps_its_worker():
    seen = run(["a", "b", "c"])
    assert seen.results == {"a": "aa", "b": "bb", "c": "cc"}
    assert len(set(seen.pids.values())) == 1
    assert not seen.failures


@pytest.mark.parametrize(
    ("what", "status", "words"),
    [
        ("kill", "failed", "SIGKILL"),
        ("abort", "failed", "SIGABRT: LLVM ERROR: out of registers"),
        ("raise", "failed", "ValueError: bad value"),
        ("trap", "failed", "what the worker sent cannot be read: RuntimeError: out of the pickle"),
        ("unsupported", "unsupported", "no events"),
        ("unavailable", "unavailable", "not installed"),
    ],
)
def test_a_failed_job_says_why_and_the_lane_goes_on(what, status, words):
    seen = run(["before", what, "after"], ["other"])
    assert seen.failures[what].status == status
    assert words in seen.failures[what].reason
    assert seen.results == {"before": "beforebefore", "after": "afterafter", "other": "otherother"}


def test_a_job_that_cannot_be_sent_is_named_whatever_its_classes_raise():
    with pytest.raises(HenonRefError, match=r"a job of a cannot be sent to its worker \(ValueError: no state\)"):
        Fence(processes=1, memory=memory()).run([Lane("a", deque([Stuck()]))], Collector())


@pytest.mark.parametrize("what", ["hang", "spin"])
def test_a_hang_is_ended_at_its_deadline(what):
    seen = run([what, "after"], collector=Collector(seconds=0.3))
    assert seen.failures[what].status == "timeout"
    assert seen.results == {"after": "afterafter"}
    assert gone(seen.pids[what])


@pytest.mark.parametrize("what", ["eat", "gulp"])
def test_memory_beyond_the_limit_ends_the_job(what):
    seen = run([what, "after"])
    assert seen.failures[what].status == "failed"
    assert "memory" in seen.failures[what].reason.lower()
    assert seen.results == {"after": "afterafter"}


def test_what_a_worker_started_dies_with_it():
    seen = run(["children"], collector=Collector(seconds=0.5))
    assert seen.failures["children"].status == "timeout"
    deadline = time.monotonic() + 5
    while not gone(seen.pids["child"]) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert gone(seen.pids["child"])


def test_an_interrupt_leaves_no_process_behind():
    class Interrupted(Collector):
        def finished(self, lane, job, failure):
            super().finished(lane, job, failure)
            raise KeyboardInterrupt

    collector = Interrupted()
    with pytest.raises(KeyboardInterrupt):
        run(["a"], ["hang"], collector=collector)
    assert collector.done == ["a"]
    deadline = time.monotonic() + 5
    while not all(gone(pid) for pid in collector.pids.values()) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert all(gone(pid) for pid in collector.pids.values())


@pytest.mark.skipif(sys.platform != "linux", reason="the parent-death signal is Linux's")
@pytest.mark.parametrize("begin", ["", NURSERY])
def test_workers_die_with_a_killed_parent(tmp_path, begin):
    parent = subprocess.Popen(
        [sys.executable, str(script(tmp_path, begin, 'run(["hang"], collector=Tell(60))'))],
        stdout=subprocess.PIPE,
        text=True,
    )
    worker = int(parent.stdout.readline())
    family = {worker, *begun_by(parent.pid)}  # a fork server and its helper, too
    assert len(family) == (3 if begin else 1)
    parent.kill()
    parent.wait()
    parent.stdout.close()
    wait_until(lambda: all(gone(pid) for pid in family))


@pytest.mark.skipif(sys.platform != "linux", reason="there is a nursery on Linux only")
def test_a_nursery_has_imported_what_workers_need_and_does_all_that_a_fence_does(tmp_path):
    """The command has imported nothing of it; who wants what the command has imported is forked from there."""
    code = """
        seen, here = Collector(), Collector()
        run(["a", "abort", "imported", "kill"], ["b"], collector=seen)
        Fence(processes=1, memory=memory()).run([Lane("here", deque([Act("imported")]), here=True)], here)
        words = [seen.failures[what].reason for what in ("abort", "kill")]
        print(sorted(seen.results.items()), *words, here.results, sep="; ")
        """
    done = subprocess.run(
        [sys.executable, str(script(tmp_path, NURSERY, code))], capture_output=True, text=True, check=True, timeout=120
    )
    results, abort, kill, here = done.stdout.strip().split("; ")
    assert results == "[('a', 'aa'), ('b', 'bb'), ('imported', True)]"
    assert abort.endswith("SIGABRT: LLVM ERROR: out of registers")
    assert "SIGKILL" in kill
    assert here == "{'imported': False}"
    assert done.stderr == ""


INTERRUPTED = """
import os, signal, sys

class Interrupt:
    def find_spec(self, name, path=None, target=None):
        if name == "henon_ref.henon.solvers":
            os.write(2, b"interrupted\\n")
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupt())
"""
"""A sitecustomize: whoever imports the reference's solvers gets an interrupt there."""


@pytest.mark.skipif(sys.platform != "linux", reason="there is a nursery on Linux only")
def test_a_nursery_takes_no_interrupt_not_even_while_it_imports(tmp_path):
    """An interrupt goes to all processes of a terminal: it would have a traceback of its own."""
    (tmp_path / "sitecustomize.py").write_text(INTERRUPTED)
    places = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    done = subprocess.run(
        [sys.executable, str(script(tmp_path, NURSERY, 'print(run(["imported"]).results)'))],
        capture_output=True,
        text=True,
        timeout=120,
        env=os.environ | {"PYTHONPATH": places},
    )
    assert (done.stderr, done.stdout) == ("interrupted\n", "{'imported': True}\n")


@pytest.mark.parametrize(
    "without",
    [
        "def refuse(): raise OSError('no socket')\nforkserver.ensure_running = refuse",
        "os.sched_getaffinity = lambda process: {0}",
    ],
)
def test_where_there_is_no_socket_or_no_second_core_workers_are_forked(tmp_path, without):
    begin = f"from multiprocessing import forkserver, get_start_method\n{without}\n{NURSERY}"
    code = 'print(run(["a"]).results, get_start_method(allow_none=True))'
    done = subprocess.run(
        [sys.executable, str(script(tmp_path, begin, code))], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout == "{'a': 'aa'} None\n"


def begun_by(parent: int) -> list[int]:
    """Processes that a process has begun."""
    return [int(word) for word in Path(f"/proc/{parent}/task/{parent}/children").read_text().split()]


def script(folder: Path, begin: str, code: str) -> Path:
    """A program that has these tests' jobs."""
    path = folder / "parent.py"
    head = textwrap.dedent(f"""
        import os, sys
        from collections import deque
        os.sched_getaffinity = lambda process: {{0, 1}}
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        from jobs import Act, Collector, Fence, Lane, Tell, memory, run
        """)
    inside = textwrap.indent(textwrap.dedent(begin) + "\n" + textwrap.dedent(code), "    ")
    path.write_text(f'{head}\nif __name__ == "__main__":\n{inside}\n')
    return path


def wait_until(true, seconds: float = 5.0) -> None:
    deadline = time.monotonic() + seconds
    while not true() and time.monotonic() < deadline:
        time.sleep(0.02)
    assert true()


def test_spawned_workers_do_the_same(monkeypatch):
    monkeypatch.setattr(process, "_context", lambda *, here: multiprocessing.get_context("spawn"))
    seen = run(["a", "kill", "b", "abort"])
    assert seen.results == {"a": "aa", "b": "bb"}
    assert "SIGKILL" in seen.failures["kill"].reason
    assert seen.failures["abort"].reason.endswith("SIGABRT: LLVM ERROR: out of registers")
