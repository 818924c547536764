"""Starts of workers: from a server, by fork, by spawn; and their end with the caller."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading

import pytest
from jobs import Act, noted, run
from processes import gone, script, wait_until

from henon_ref.workers import worker_process
from henon_ref.workers.machine import family

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="what processes hold and use is told by Linux's /proc")

SERVER = """
from henon_ref.harness.campaign import WORKERS_NEED
from henon_ref.workers import worker_process
worker_process.begin_server(*WORKERS_NEED)
"""


@pytest.mark.parametrize("begin", ["", SERVER])
def test_all_die_with_a_killed_caller(tmp_path, begin):
    notes = tmp_path / "pids"
    code = f'run([Act("leave_a_daemon", 60.0, {str(notes)!r}), Act("hang", 60.0, {str(notes)!r})])'
    caller = subprocess.Popen([sys.executable, str(script(tmp_path, begin, code))])
    wait_until(lambda: len(noted(notes)) == 3)
    members = {*noted(notes), *family(caller.pid)} - {caller.pid}
    assert len(members) >= 3  # worker, daemon, guard, and what begins them
    caller.kill()
    caller.wait()
    wait_until(lambda: all(map(gone, members)))


def test_a_worker_that_begins_afresh_ends_with_a_killed_caller(tmp_path):
    notes = tmp_path / "pids"
    path = script(tmp_path, "", f'run([Act("hang", 60.0, {str(notes)!r})])')
    caller = subprocess.Popen([sys.executable, str(path)], env={**os.environ, "HENON_REF_START": "spawn"})
    wait_until(lambda: len(noted(notes)) == 1)
    caller.kill()
    caller.wait()
    (worker,) = noted(notes)
    wait_until(lambda: gone(worker))
    assert gone(worker)


def test_the_command_s_server_has_imported_what_workers_need_and_is_as_good(tmp_path):
    """The command itself has imported nothing of it."""
    code = """
        seen = run(["a", "abort", "imported", "kill"], ["b"])
        print(sorted(seen.results.items()), *(seen.failures[what].reason for what in ("abort", "kill")), sep="; ")
        print("henon_ref.integrator.integrator" in sys.modules)
        """
    done = subprocess.run(
        [sys.executable, str(script(tmp_path, SERVER, code))], capture_output=True, text=True, check=True, timeout=600
    )
    results, abort, kill = done.stdout.splitlines()[0].split("; ")
    assert results == "[('a', 'aa'), ('b', 'bb'), ('imported', True)]"
    assert abort.endswith("SIGABRT: LLVM ERROR: out of registers")
    assert "SIGKILL" in kill
    assert done.stdout.splitlines()[1] == "False"
    assert done.stderr == ""


@pytest.mark.parametrize(
    "without",
    [
        "def refuse(*given): raise OSError('no socket')\nworker_process.server.ensure_running = refuse",
        "os.sched_getaffinity = lambda process: {0}",
    ],
)
def test_where_there_is_no_socket_or_no_second_core_workers_are_forked_from_the_caller(tmp_path, without):
    code = 'print(run(["a"]).results, worker_process.start_method())'
    begin = SERVER.replace("worker_process.begin", f"{without}\nworker_process.begin")
    done = subprocess.run(
        [sys.executable, str(script(tmp_path, begin, code))], capture_output=True, text=True, check=True, timeout=600
    )
    assert done.stdout == "{'a': 'aa'} fork\n"


def test_a_caller_with_threads_has_workers_of_a_fresh_process():
    waiting = threading.Event()
    other = threading.Thread(target=waiting.wait)
    other.start()
    try:
        seen = run(["a", "kill", "b", "abort"])
    finally:
        waiting.set()
        other.join()
    assert seen.results == {"a": "aa", "b": "bb"}
    assert "SIGKILL" in seen.failures["kill"].reason
    assert seen.failures["abort"].reason.endswith("SIGABRT: LLVM ERROR: out of registers")


def test_workers_that_begin_afresh_are_killed_and_bounded_as_well(monkeypatch, tmp_path):
    """As where there is no fork: what ends with a worker then is its process group."""
    monkeypatch.setattr(worker_process, "start_method", lambda: "spawn")
    notes = tmp_path / "pids"
    seen = run(["keep", "kept", "eat", "after"], [Act("children", 0.5, str(notes)), "kill", "stray_done"])
    assert seen.results == {"keep": "keepkeep", "kept": "kept", "after": "afterafter"}
    assert seen.failures["children"].status == "timeout"
    assert seen.failures["eat"].reason.startswith("memory")
    assert "SIGKILL" in seen.failures["kill"].reason
    assert "no reply" in seen.failures["stray_done"].reason
    wait_until(lambda: all(map(gone, noted(notes))))


def test_a_guard_that_is_gone_before_it_is_woken_is_no_failure(monkeypatch):
    """Its exit status comes from the server that began it, and may come later than its end."""
    kill, woken = os.kill, []

    def late(pid: int, number: int) -> None:
        if number == signal.SIGCONT:
            woken.append(pid)
            raise ProcessLookupError
        kill(pid, number)

    monkeypatch.setattr(os, "kill", late)
    assert run(["a", "b"]).results == {"a": "aa", "b": "bb"}
    assert woken


def test_a_script_that_compares_where_it_is_imported_is_told_so_and_leaves_nothing_behind(tmp_path):
    path = script(
        tmp_path,
        "",
        """
        import threading
        threading.Thread(target=threading.Event().wait, daemon=True).start()
        run(["a"], main=True)
        """,
    )
    path.write_text(path.read_text().replace('if __name__ == "__main__":', "if True:"))
    done = subprocess.run([sys.executable, str(path)], capture_output=True, text=True, timeout=600)
    assert done.returncode == 1
    assert 'put the call under if __name__ == "__main__"' in done.stderr
    assert "4 worker processes ended before they had started" in done.stderr
