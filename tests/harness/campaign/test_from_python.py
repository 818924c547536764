"""``compare`` called from scripts: without a main guard, with threads, interrupted."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from processes import gone, wait_until

import henon_ref
from henon_ref.errors import CaseError
from henon_ref.workers.machine import family

ROOT = Path(__file__).parents[3]
CASE = ROOT / "cases" / "leaving_slide.yaml"
THREAD = "import threading; threading.Thread(target=threading.Event().wait, daemon=True).start()\n"
COMPARE = f"""
import henon_ref
case = henon_ref.load_case({str(CASE)!r})
found = henon_ref.compare(case, solvers=["henon"], tolerances=[1e-6], repeats=1)
print(found.runs["verdict"].tolist())
"""
OWN = f"""
import henon_ref
from fakes import Fake
class Own(Fake):
    pass
case = henon_ref.load_case({str(CASE)!r})
def main():
    found = henon_ref.compare(case, solvers=[Own("own", "unsupported")], tolerances=[1e-6], repeats=1)
    print(found.runs["status_reason"].tolist())
"""
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="what processes there are is told by Linux's /proc")


def python(*arguments: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests/support")])
    return subprocess.run(
        [sys.executable, *arguments],
        capture_output=True, text=True, timeout=600, env=dict(os.environ) | {"PYTHONPATH": path},
    )  # fmt: skip


def script(folder: Path, code: str) -> str:
    path = folder / "script.py"
    path.write_text(textwrap.dedent(code))
    return str(path)


def test_a_script_with_threads_needs_no_guard(tmp_path):
    done = python(script(tmp_path, THREAD + COMPARE))
    assert done.stdout == "['right']\n", done.stderr
    assert done.stderr == ""  # nobody watches: no progress


@pytest.mark.parametrize("begin", ["main()", f"{THREAD}if __name__ == '__main__':\n    main()"])
def test_a_script_may_hand_over_a_solver_of_its_own(tmp_path, begin):
    done = python(script(tmp_path, f"{OWN}\n{begin}"))
    assert done.stdout == "['it cannot']\n", done.stderr


def test_a_solver_that_no_other_process_finds_is_refused_with_the_mend():
    done = python("-c", f"{THREAD}{OWN}\nmain()")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].endswith("write it into a module and import it from there")


def test_a_script_needs_no_guard_and_shows_progress_where_it_is_wanted(tmp_path):
    done = python(script(tmp_path, COMPARE.replace("repeats=1", "repeats=1, progress=True")))
    assert done.stdout == "['right']\n", done.stderr
    *_, last = done.stderr.splitlines()
    assert last.startswith("leaving_slide: 1 of 1 rows, ")
    assert "\r" not in done.stderr  # a file keeps every line
    with pytest.raises(CaseError, match="progress is 'yes', wanted None, True or False"):
        henon_ref.compare(henon_ref.load_case(CASE), solvers=["henon"], progress="yes")


@pytest.mark.parametrize("before", ["", THREAD], ids=["one thread", "two threads"])
def test_an_interrupt_ends_a_comparison_and_leaves_no_process(tmp_path, before):
    notes = tmp_path / "notes"
    code = f"""
        import henon_ref
        from fakes import Fake
        case = henon_ref.load_case({str(CASE)!r})
        henon_ref.compare(case, solvers=[Fake("hangs", "hangs", log={str(notes)!r})], timeout=600)
        """
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests/support")])
    caller = subprocess.Popen(
        [sys.executable, script(tmp_path, before + textwrap.dedent(code))],
        stderr=subprocess.PIPE, text=True, start_new_session=True, env=dict(os.environ) | {"PYTHONPATH": path},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell's jobs in the background ignore it
    )  # fmt: skip
    wait_until(notes.exists)
    members = family(caller.pid)
    assert len(members) >= 3  # itself, fork server, worker
    os.killpg(caller.pid, signal.SIGINT)
    assert caller.communicate(timeout=600)[1].splitlines()[-1] == "KeyboardInterrupt"
    wait_until(lambda: all(map(gone, members)))


def test_an_interrupt_while_the_fork_server_imports_is_told_by_the_caller_only(tmp_path):
    (tmp_path / "slow.py").write_text("import time, pathlib; pathlib.Path('importing').touch(); time.sleep(2)")
    code = """
        import time
        from henon_ref.workers.worker_process import WorkerProcess
        worker = WorkerProcess(modules=["slow"])
        time.sleep(600)
        """
    caller = subprocess.Popen(
        [sys.executable, script(tmp_path, THREAD + textwrap.dedent(code))], cwd=tmp_path,
        stderr=subprocess.PIPE, text=True, start_new_session=True, env=dict(os.environ) | {"PYTHONPATH": str(ROOT)},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    wait_until((tmp_path / "importing").exists)
    os.killpg(caller.pid, signal.SIGINT)
    assert caller.communicate(timeout=600)[1].count("KeyboardInterrupt") == 1
