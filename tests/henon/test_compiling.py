"""Compiling the loop: once a machine, by two processes that need it at the same time."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from henon_ref.jit import njit as jit

SCRIPT = """
import json, sys
from henon_ref.henon.loop import advance
from henon_ref.henon.loop import called
from henon_ref.henon.solver import HENON_SOLVER
from problems import make_problem
found = HENON_SOLVER.prepare(make_problem(*json.loads(sys.argv[1])), rtol=1e-9)()
parts = called(advance.signatures[0][3])
made = [sum(function.stats.cache_misses.values()) for function in (advance, *(function for function, _ in parts))]
signatures = [function.signatures == [types] for function, types in parts]
print(json.dumps([found.transitions[0].time, made, signatures]))
"""


@pytest.mark.slow  # daily: tests/jit/test_shared_compiling.py, where what is compiled is made up
@pytest.mark.parametrize(
    "problem",
    [("x", ["t - s"], {"s": "x"}, [0], 3), ("x y", ["t - s", "-2 - u"], {"s": "x", "u": "y"}, [0, 9], 3)],
    ids=["one surface", "two surfaces"],
)
def test_two_processes_share_the_work(problem: tuple[Any, ...], tmp_path: Path) -> None:
    """One compiles the loop and the other waits for it; what it calls is compiled by both, each part by one of them."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    folder = Path(__file__).parents[1] / "support"
    both = [
        subprocess.Popen(
            [sys.executable, "-c", SCRIPT, json.dumps(problem)], env=environment, cwd=folder, stdout=subprocess.PIPE
        )
        for _ in range(2)
    ]
    printed = [process.communicate(timeout=600)[0] for process in both]
    assert [process.returncode for process in both] == [0, 0]
    results = [json.loads(text) for text in printed]
    assert [time for time, _, _ in results] == [1.0, 1.0]
    one, other = (made for _, made, _ in results)
    assert [a + b for a, b in zip(one, other, strict=True)] == [1] * len(one)
    assert any(one[1:])
    assert any(other[1:])
    assert all(all(signatures) for _, made, signatures in results if made[0])


UNITS = """
import json
from henon_ref.henon import compile_units, loop
compile_units.link()
functions = [function for function, _ in compile_units.UNITS.values()]
print(json.dumps([sum(function.stats.cache_misses.values()) for function in functions]))
"""


@pytest.mark.slow  # daily: the same
def test_a_unit_is_compiled_by_whoever_comes_first(tmp_path: Path) -> None:
    """Each function by one of two processes, and none of them does it all."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    both = [subprocess.Popen([sys.executable, "-c", UNITS], env=environment, stdout=subprocess.PIPE) for _ in range(2)]
    printed = [process.communicate(timeout=600)[0] for process in both]
    one, other = (json.loads(text) for text in printed)
    assert [a + b for a, b in zip(one, other, strict=True)] == [1] * len(one)
    assert any(one)
    assert any(other)


def test_another_copy_of_the_package_compiles_for_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else two processes of it would find the other's loop on the disk, could not use it, and compile all twice."""
    here = Path(jit.__file__)
    own = jit.cache_folder()
    assert jit.cache_folder.__wrapped__() == own
    package = here.parents[1]
    for room in jit.COMPILED:
        shutil.copytree(package / room, tmp_path / room, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(jit, "__file__", str(tmp_path / "jit" / here.name))
    assert jit.cache_folder.__wrapped__() != own
