"""Whoever does the chunks, and however they are cut: the same numbers to the last bit."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path
from textwrap import dedent
from typing import Any

import numpy as np
import pytest
from often import daily
from sweep_systems import assert_same, belt, parquet_files

from henon_ref.errors import ArgumentError, HenonRefError
from henon_ref.sweeps import observe
from henon_ref.sweeps.points import continuation
from henon_ref.sweeps.sweep import SweepTable, sweep
from henon_ref.workers import worker_process
from henon_ref.workers.executors import TRIES, finished

WANTED = [
    observe.sticks(after=20, each=True),
    observe.final_state(),
    observe.section("x", after=20),
    observe.period("x", after=10),
    observe.extremes("x", after=20),
    observe.status(),
]


def swept(until: float = 60, **how: Any) -> SweepTable:
    grid = {"vb": np.linspace(0.05, 1, 6), "x": [-1.0, 0.0, 1.5, 2.0]}
    return sweep(belt(), {"x": 0, "v": 0}, until=until, grid=grid, observe=WANTED, rtol=1e-9, **how)


@pytest.fixture(scope="module")
def whole() -> SweepTable:
    """All in one chunk, in this process."""
    return swept(jobs=1, chunk=24)


@pytest.fixture(params=["fork", "forkserver", "spawn"])
def processes(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """How worker processes begin: as copies of this one, of the fork server, or afresh."""
    if request.param != "spawn" and sys.platform != "linux":
        pytest.skip("only Linux forks")
    monkeypatch.setattr(worker_process, "start_method", lambda: request.param)
    return str(request.param)


@pytest.mark.parametrize("chunk", [1, 7])
def test_chunks_change_no_bit(whole: SweepTable, chunk: int) -> None:
    assert_same(swept(jobs=1, chunk=chunk), whole)


def test_processes_change_no_bit(whole: SweepTable, processes: str) -> None:
    assert_same(swept(jobs=2, chunk=5), whole)


def test_beside_another_thread_nothing_is_forked() -> None:
    began, ends = threading.Event(), threading.Event()
    other = threading.Thread(target=lambda: (began.set(), ends.wait()))
    other.start()
    began.wait()
    try:
        assert worker_process.start_method() != "fork"
    finally:
        ends.set()
        other.join()


def test_threads_change_no_bit(whole: SweepTable) -> None:
    with ThreadPoolExecutor(3) as pool:
        assert_same(swept(executor=pool, chunk=2), whole)


def test_processes_of_somebody_elses_change_no_bit(whole: SweepTable, another: ProcessPoolExecutor) -> None:
    assert_same(swept(executor=another, chunk=9), whole)


@pytest.fixture(scope="module")
def another() -> Iterator[ProcessPoolExecutor]:
    """A process of its own: a cluster leaves threads behind, beside which no worker is forked."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        yield pool


def on_a_cluster() -> SweepTable:
    import distributed

    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        return swept(executor=client, chunk=5)


def test_a_dask_cluster_changes_no_bit(whole: SweepTable, another: ProcessPoolExecutor) -> None:
    pytest.importorskip("distributed")
    assert_same(another.submit(on_a_cluster).result(), whole)


def on_a_cluster_that_dies(out: Path) -> str:
    """What is said where the scheduler is gone in the middle of a sweep, and where it is gone before."""
    import distributed

    logging.disable()  # the cluster tells every connection that it has lost
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None, protocol="tcp"
    ) as cluster:
        client = distributed.Client(cluster.scheduler_address, timeout=10)

        def close_after_three() -> None:
            while len(list(out.glob("points/*.parquet"))) < 3:
                time.sleep(0.01)
            cluster.close()

        threading.Thread(target=close_after_three, daemon=True).start()
        said = []
        for _ in range(2):
            try:
                swept(executor=client, chunk=1, until=4000, out=out, resume=True)
            except HenonRefError as error:
                said.append(str(error))
        client.close()
        with pytest.raises(ArgumentError, match="closed"):
            swept(executor=client)
        return "\n".join(said)


@pytest.mark.slow  # a cluster, and long sweeps; daily: an executor that is shut down, the next test
def test_a_scheduler_that_dies_leaves_word_of_what_is_finished(tmp_path: Path, another: ProcessPoolExecutor) -> None:
    """It was a bare CancelledError."""
    pytest.importorskip("distributed")
    out = tmp_path / "out"
    said = another.submit(on_a_cluster_that_dies, out).result().splitlines()
    finished = len(list(out.glob("points/*.parquet")))
    assert 3 <= finished < 24
    assert len(said) == 2
    for words in said:
        assert words.startswith("the executor has ended or dropped its tasks, for example because one of its")
        assert words.endswith(
            f"{finished} of 24 chunks are finished and stored in {out}; --resume (resume=True) continues from them"
        )
    whole = swept(jobs=1, chunk=1, until=4000)
    assert_same(swept(jobs=1, chunk=1, until=4000, out=out, resume=True), whole)


def test_an_executor_that_is_shut_down_says_so() -> None:
    executor = ThreadPoolExecutor(1)
    executor.shutdown()
    with pytest.raises(HenonRefError, match="0 of 8 chunks are finished but lost, since no folder"):
        swept(executor=executor, chunk=3)


class UnreadError(Exception):
    """Can be pickled, but not read again."""

    def __init__(self, first: str, second: str) -> None:
        super().__init__(f"{first} {second}")


def _unread(number: int) -> int:
    raise UnreadError("own", "words")


def test_a_process_of_somebody_elses_names_what_fails_in_it() -> None:
    """An exception that cannot be read was a BrokenProcessPool, and its text was lost."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        with pytest.raises(HenonRefError, match="UnreadError in a worker: own words"):
            dict(finished(_unread, [(0, (0,))], executor=pool))
        with pytest.raises(HenonRefError, match=r"one of its processes .* died \(BrokenProcessPool: A process"):
            dict(finished(_dies, [(0, (0,))], executor=pool))


class AtOnce(Executor):
    """Executes each task when it is submitted."""

    def submit(self, function: Any, /, *arguments: Any, **options: Any) -> Future[Any]:
        future = Future[Any]()
        try:
            future.set_result(function(*arguments))
        except ZeroDivisionError as error:
            future.set_exception(error)
        return future


def test_finished_tasks_come_before_the_exception_of_another() -> None:
    results = finished(divmod, [(k, (6, k)) for k in range(4)], executor=AtOnce())
    assert [next(results) for _ in range(3)] == [(1, (6, 0)), (2, (3, 0)), (3, (2, 0))]
    with pytest.raises(ZeroDivisionError):
        next(results)


def test_chains_are_cut_nowhere() -> None:
    points = continuation({"vb": np.linspace(0.1, 1, 5)}, {"x": [-1.0, 0.0, 1.5]})
    arguments: dict[str, Any] = {"until": 30, "grid": points, "observe": [observe.final_state()], "rtol": 1e-9}
    one = sweep(belt(), {"x": 0, "v": 0}, jobs=1, chunk=30, **arguments)
    assert_same(sweep(belt(), {"x": 0, "v": 0}, jobs=2, chunk=1, **arguments), one)


@pytest.mark.parametrize("executor", [3, "processes", object()])
def test_what_is_no_executor_is_refused(executor: object) -> None:
    with pytest.raises(ArgumentError, match="executor"):
        swept(executor=executor)


@pytest.mark.parametrize("how", [{"jobs": 0}, {"jobs": 1.5}, {"chunk": 0}, {"chunk": True}])
def test_what_is_no_number_of_things_is_refused(how: dict[str, Any]) -> None:
    with pytest.raises(ArgumentError, match="whole number"):
        swept(**how)


def _dies_once(mark: str, number: int) -> int:
    path = Path(mark)
    if number == 3 and not path.exists():
        path.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def _dies(number: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return number


@pytest.mark.parametrize("processes", daily(["fork", "forkserver", "spawn"], some=["fork"]), indirect=True)
def test_a_task_whose_worker_is_killed_is_done_again(processes: str, tmp_path: Path) -> None:
    tasks = ((k, (str(tmp_path / "mark"), k)) for k in range(60))
    assert dict(finished(_dies_once, tasks, jobs=2)) == {k: k * k for k in range(60)}


def test_a_task_that_kills_every_worker_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """However they begin; a copy of this process begins sooner."""
    monkeypatch.setattr(worker_process, "start_method", lambda: "fork" if sys.platform == "linux" else "spawn")
    with pytest.raises(HenonRefError, match=f"{TRIES} workers ended"):
        dict(finished(_dies, [(0, (0,))], jobs=2))


def test_a_script_needs_no_guard(tmp_path: Path) -> None:
    """Nor does a function that it defines have to be found by the workers."""
    script = tmp_path / "script.py"
    script.write_text(
        dedent(
            """
            import henon_ref as hr
            block = hr.System(["x", "v"], {"F": 1}, {"s": "v"}, ["v", "-F*s"])
            def last(run):
                return run.t[-1]
            table = hr.sweep(
                block, {"x": 0, "v": 1}, until=3, grid={"F": [1, 2]}, observe=[hr.observe.function(last)], jobs=2
            )
            print(table["value"].tolist())
            """
        )
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True, timeout=600)
    assert done.stdout.strip() == "[3.0, 3.0]"


def test_workers_that_are_killed_leave_the_same_files(tmp_path: Path) -> None:
    """From outside, while it is at work."""
    pytest.importorskip("pyarrow")
    code = dedent(
        f"""
        import numpy as np, henon_ref as hr
        field = ["v", "-x - F*s/(1 + d*s*(v - vb))"]
        block = hr.System(["x", "v"], {{"F": 1, "d": 3, "vb": 0.5}}, {{"s": "v - vb"}}, field)
        hr.sweep(block, {{"x": 0, "v": 0}}, until=5000, grid={{"vb": np.linspace(0.1, 1, 60)}}, rtol=1e-9,
                 observe=[hr.observe.final_state()], jobs=2, chunk=5, out={str(tmp_path / "killed")!r})
        """
    )
    process = subprocess.Popen([sys.executable, "-c", code])
    killed = 0
    ends = time.monotonic() + 600
    while process.poll() is None and time.monotonic() < ends:
        if (tmp_path / "killed" / "points").is_dir() and killed < 2:
            for pid in _workers_of(process.pid)[:1]:
                with suppress(ProcessLookupError):  # it has just ended
                    os.kill(pid, signal.SIGKILL)
                    killed += 1
            time.sleep(0.2)
        time.sleep(0.005)
    assert process.wait(timeout=600) == 0
    assert killed
    arguments: dict[str, Any] = {"until": 5000, "grid": {"vb": np.linspace(0.1, 1, 60)}, "rtol": 1e-9}
    sweep(
        belt(), {"x": 0, "v": 0}, observe=[observe.final_state()], jobs=1, chunk=5, out=tmp_path / "whole", **arguments
    )
    assert parquet_files(tmp_path / "killed") == parquet_files(tmp_path / "whole")


def _workers_of(pid: int) -> list[int]:
    """Workers that a process has begun."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rsplit(")", 1)[1].split()
            words = (path.parent / "cmdline").read_bytes()
        except OSError:
            continue
        if int(fields[1]) == pid and b"resource_tracker" not in words:
            found.append(int(path.parent.name))
    return found
