"""An exchange with any program returns its output or one sentence, in bounded time, and leaves no process behind."""

from __future__ import annotations

import os
import sys

import pytest
from jobs import crowd
from processes import gone, wait_until
from programs import FINE, PRELUDE, RAMP, answer, program, ramp

import henon_ref
from henon_ref.baselines.protocol import exchange as module
from henon_ref.baselines.protocol.exchange import exchange
from henon_ref.errors import ContractError, DeadlineError, UnavailableError
from henon_ref.harness.score.gate import demand
from henon_ref.solver import SelfTimedRun, Solver

SHORT = 1.0
"""Seconds of a program that is to be stopped, ..."""
LONG = 60.0
"""... and of one that is to answer, however busy the machine is."""


def say(code: str, seconds: float = LONG, request: bytes = b"{}", memory: int = 4 * 2**30) -> bytes:
    command = (sys.executable, "-c", PRELUDE + code)
    return exchange(command, request, seconds, memory=memory, most_output=10_000)


def test_a_program_gets_the_request_and_its_output_comes_back() -> None:
    assert say("print(request['a'])", request=b'{"a": "\xc3\xa9"}') == "é\n".encode()


def test_a_request_that_nobody_reads_is_no_matter() -> None:
    large = b" " * 2_000_000
    assert exchange((sys.executable, "-c", "print(1)"), large, LONG) == b"1\n"


def test_a_program_that_hangs_is_stopped() -> None:
    with pytest.raises(DeadlineError, match=r"no response within 2.5 s"):
        say("time.sleep(1000)", SHORT)


@pytest.mark.parametrize("code", ["pass", "import signal; signal.signal(signal.SIGXCPU, signal.SIG_IGN)"])
def test_a_program_that_computes_for_ever_is_stopped_by_its_processor_time(code: str, monkeypatch) -> None:
    """By what the system says of its end: our clock stands, for what counts is used before anybody looks at a clock."""
    monkeypatch.setattr(module, "monotonic", lambda: 0.0)
    with pytest.raises(DeadlineError, match="stopped after 1 s of processor time"):
        say(f"{code}\nwhile True: pass", SHORT)


@pytest.mark.skipif(not os.path.exists("/proc/self/schedstat"), reason="the system does not tell who waits")
def test_a_program_that_waits_for_a_processor_is_not_late() -> None:
    """It takes a seventh of one, so that it is at it for longer than the wall time that it may take."""
    burn = "\nwhile time.process_time() < 0.6: pass\nprint(1)"
    with crowd() as processor:
        assert say(f"os.sched_setaffinity(0, [{processor}]){burn}", SHORT) == b"1\n"


def test_a_program_that_somebody_kills_has_crashed_however_long_it_took() -> None:
    with pytest.raises(ContractError, match="the program crashed, SIGKILL") as caught:
        say("time.sleep(1.5); os.kill(os.getpid(), 9)", SHORT)
    assert not isinstance(caught.value, DeadlineError)


def test_a_flood_is_cut_off() -> None:
    with pytest.raises(ContractError, match="more than 10000 bytes"):
        say("\nwhile True: print('x' * 1000)")


def test_a_flood_of_errors_is_no_matter_where_there_is_a_response() -> None:
    assert say("sys.stderr.write('x' * 1_000_000); print(2)") == b"2\n"


def test_a_crash_is_told_by_its_signal_and_last_words() -> None:
    with pytest.raises(ContractError, match=r"the program crashed, SIGSEGV: last words"):
        say("sys.stderr.write('last words'); sys.stderr.flush(); os.kill(os.getpid(), 11)")


def test_an_exit_status_is_told_with_what_was_said() -> None:
    with pytest.raises(ContractError, match=r"the program ended with exit status 3: no� licence"):
        say("sys.stderr.buffer.write(b'no\\xff\\nlicence'); sys.exit(3)")


def test_memory_is_bounded() -> None:
    with pytest.raises(ContractError, match="MemoryError"):
        say("x = bytearray(10**10)", 30.0, memory=2**29)


def test_what_a_program_has_started_ends_with_it() -> None:
    code = (
        "import subprocess; p = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(1000)']); print(p.pid)"
    )
    pid = int(say(code))
    wait_until(lambda: gone(pid))
    assert gone(pid)


def test_a_program_that_is_not_there_is_unavailable() -> None:
    with pytest.raises(UnavailableError, match="/no/such/program cannot be started: No such file"):
        exchange(("/no/such/program",), b"{}", SHORT)
    with pytest.raises(UnavailableError, match="no program /no/such/program"):
        henon_ref.ProgramSolver("none", ("/no/such/program",), landing="none").check()


def test_a_program_is_a_solver_and_its_run_is_timed_by_itself() -> None:
    solver = program(answer())
    assert isinstance(solver, Solver)
    run = solver.prepare(ramp(), rtol=1e-6)
    assert isinstance(run, SelfTimedRun)
    found = run()
    assert [(event.kind, event.time, event.state) for event in found.transitions] == [("crossing", 1.0, (0.0,))]
    assert run.wall_s == FINE["wall_s"][0]
    assert run.times(3) == (1e-3, 1e-3, 1e-3)


def test_a_time_that_is_missing_is_told() -> None:
    with pytest.raises(ContractError, match="wall_s: 1 times, wanted 3"):
        program(answer(wall_s=[0.5])).prepare(ramp(), rtol=1e-6).times(3)


BAD = {
    "hang": ("time.sleep(1000)", "timeout", "gave no response within"),
    "flood": ("sys.stdout.write('x' * 10**8)", "failed", "more than 67108864 bytes to its standard output"),
    "errors": ("sys.stderr.write('x' * 10**8)", "failed", "more than 67108864 bytes to its standard error"),
    "garbage": ("sys.stdout.buffer.write(bytes(range(256)) * 9)", "failed", "is refused: Invalid JSON"),
    "crash": ("os.abort()", "failed", "the program crashed, SIGABRT"),
    "nothing": ("pass", "failed", "the program wrote nothing"),
    "partial": ("sys.stdout.write(json.dumps(request)[:40])", "failed", "is refused: Invalid JSON: EOF"),
    "utf8": ('sys.stdout.buffer.write(b\'{"protocol": "\\xff\\xfe"}\')', "failed", "is refused: Invalid JSON"),
    "nan": (answer(end={"time": 2.0, "state": [float("nan")], "mode": 1}), "failed", "end.state.0: Input should be"),
    "types": (answer(transitions="none"), "failed", "transitions: Input should be a valid"),
    "text": (answer(wall_s=["0.1"]), "failed", "wall_s.0: Input should be a valid number, not '0.1'"),
    "unknown": (answer(colour="red"), "failed", "colour: Extra inputs are not permitted"),
    "order": (
        answer(
            transitions=[
                {"time": 1.5, "before": -1, "after": 1, "state": [0.0]},
                {"time": 0.5, "before": 1, "after": -1, "state": [0.0]},
            ]
        ),
        "failed",
        "transitions.1.time: 0.5 is before 1.5",
    ),
    "unsupported": (answer(status="unsupported", reason="no odd numbers"), "unsupported", "no odd numbers"),
    "unavailable": (answer(status="unavailable", reason="no licence"), "unavailable", "no licence"),
}


def test_each_failure_is_a_row_that_says_so_and_the_others_stand() -> None:
    solvers = [program(code, name) for name, (code, *_) in BAD.items()]
    found = henon_ref.compare(
        henon_ref.parse_case(RAMP), solvers=[*solvers, program(answer(), "fine")], repeats=2, timeout=1.0
    )
    rows = found.runs.set_index("solver")
    assert rows.loc["fine", ["status", "verdict", "wall_s", "timed_runs"]].tolist() == ["ok", "right", 1e-3, 2]
    assert rows.loc["fine", "max_time_error_s"] == 0.0
    for name, (_, status, words) in BAD.items():
        assert rows.loc[name, "status"] == status, (name, rows.loc[name, "status_reason"])
        assert words in rows.loc[name, "status_reason"], (name, rows.loc[name, "status_reason"])
        assert rows.loc[name, "verdict"] == ("not run" if status.startswith("un") else "solver defect"), name


def test_a_program_that_hangs_on_one_of_two_readings_is_not_right_wherever_it_is_required() -> None:
    """As a Python solver that ignores its deadline; a program that keeps its deadline is not judged."""
    case = henon_ref.parse_case(RAMP + "readings: {one: {}, two: {tolerances: [1e-9]}}")
    for late, failing in (("time.sleep(1000)", 1), (answer(status="timeout", transitions=[], end=None), 0)):
        solver = program(f"\nif request['rtol'] < 1e-8: {late}\nelse: {answer()}")
        found = henon_ref.compare(case, solvers=[solver], repeats=1, timeout=1.0)
        assert found.runs["status"].tolist() == ["ok", "timeout"]
        assert len(demand("fake", found.run_rows).failures) == failing


def test_a_step_or_a_tolerance_that_is_not_wanted_is_refused() -> None:
    with pytest.raises(henon_ref.errors.UnsupportedError, match="fake is driven by rtol"):
        program(answer()).prepare(ramp(), step=0.1)


def test_descriptors_are_given_back() -> None:
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(5):
        with pytest.raises(ContractError):
            say("sys.exit(1)")
    assert len(os.listdir("/proc/self/fd")) == before
