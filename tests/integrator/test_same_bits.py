"""The reference's digits are the same on every processor with fused operations: no orbit is one machine's own."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from bits import Likeness, compare, compared, record, report
from llvmlite.binding import get_host_cpu_features
from shipped import paths

from henon_ref.jit.ir_writer import declarations
from henon_ref.jit.native_module import target
from henon_ref.taylor.llvm.expansion import expansion_ir
from henon_ref.taylor.llvm.step import bernstein_ir, step_end_ir
from henon_ref.taylor.tape import TIME, build_tape

SUPPORT = Path(__file__).parents[1] / "support"
OTHER = "haswell"
"""The first processors with fused operations, and with vectors of four doubles: the features of x86-64-v3."""
DAILY = [path.stem for path in paths(".", "classic")]
"""Cases that are recorded here, their first readings; all of all cases by ``.ci/slow``."""
LICENCE = re.compile(r"\b(fast|nnan|ninf|nsz|arcp|contract|afn|reassoc)\b|fmuladd|vector\.reduce\.f")

x, y = sp.symbols("x y", real=True)


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with records made for the other processor, in a process of its own."""
    if not {"avx2", "bmi2", "fma"} <= {name for name, has in get_host_cpu_features().items() if has}:
        pytest.skip(f"{OTHER}'s code does not run here")
    folder = tmp_path_factory.mktemp("records")
    environment = {**os.environ, "HENON_REF_CPU": OTHER, "PYTHONPATH": os.pathsep.join([str(SUPPORT), *sys.path])}
    for solver, options in {
        "henon": ["--tolerances", "1e-9", "--first", "--only", ",".join(DAILY)],
        "henon-rk4": ["--only", "free_coulomb,leaving_slide,stribeck_belt"],
        "henon-listing": ["--only", "fig8"],
    }.items():
        command = [sys.executable, "-m", "bits", "dump", str(folder / f"{solver}.json"), "--solver", solver]
        subprocess.run([*command, *options], env=environment, check=True, stdout=subprocess.PIPE)
    return folder


def _there(folder: Path, solver: str) -> dict[str, Any]:
    made = json.loads((folder / f"{solver}.json").read_text())
    assert made["target"][0] == OTHER
    assert made["runs"]
    return made["runs"]


@pytest.mark.slow  # daily: .ci/run runs this file's
def test_cases_have_the_same_bits_on_another_processor(elsewhere: Path) -> None:
    """Transitions, what rounding lost of their times, states, ends, counts."""
    found = compare(record(["1e-9"], DAILY, first=True), _there(elsewhere, "henon"))
    assert all(each.likeness is Likeness.BITS for each in found.values()), f"{target()}: {report(found)}"


@pytest.mark.slow  # daily: as above
@pytest.mark.parametrize("solver", ["henon-rk4", "henon-listing"])
def test_so_have_the_paper_s_methods(elsewhere: Path, solver: str) -> None:
    there = _there(elsewhere, solver)
    found = compare(record(only={key.split(".")[0] for key in there}, name=solver), there)
    assert all(each.likeness is Likeness.BITS for each in found.values()), f"{target()}: {report(found)}"


def test_nothing_is_written_with_licence_to_fuse_or_reorder() -> None:
    functions = (sp.sin, sp.cos, sp.tan, sp.sinh, sp.cosh, sp.tanh, sp.asin, sp.acos, sp.atan, sp.exp, sp.log, sp.sqrt)
    field = [sum(f(x + TIME) for f in functions), x**3 / (1 + y) + y ** sp.Rational(1, 3) + sp.sin(3 * TIME)]
    tape = build_tape((x, y), field, [x - y, x * y])
    text = declarations() + expansion_ir(tape, 2, 13, "f") + step_end_ir(2, 2, 13, "g") + bernstein_ir(13, "h")
    assert "@llvm.fma.v4f64" in text
    assert not LICENCE.findall(text)


def test_runs_are_told_apart_by_how_far_they_are_alike() -> None:
    """So that a record of two machines, or of two versions, tells what has changed."""
    step = {"what": ["stick", 0, [1], [0], "henon"], "time": [(1.0).hex(), (0.0).hex()], "state": [(2.0).hex()]}
    end = [(3.0).hex(), [(4.0).hex()], [0]]
    one = {"status": "ok", "transitions": [step], "end": end, "counts": [1, 2, 3]}
    low = one | {"transitions": [step | {"time": [(1.0).hex(), (1e-17).hex()]}]}
    moved = one | {"transitions": [step | {"time": [(1 + 2 * np.finfo(float).eps).hex(), (0.0).hex()]}]}
    slipped = one | {"transitions": [step | {"what": ["crossing", 0, [1], [-1], "henon"]}]}
    found = [compared(one, other) for other in (one, low, moved, slipped, one | {"status": "failed"})]
    assert [each.likeness.name for each in found] == ["BITS", "TIMES", "SEQUENCE", "DIFFERENT", "DIFFERENT"]
    assert [each.time for each in found[:3]] == [0.0, 1e-17, 2 * np.finfo(float).eps]
    worst = compare({"a": one, "b": one, "c": one}, {"a": one, "b": moved})
    assert [*worst] == ["c", "b", "a"]
    assert report(worst).startswith("3 runs: 1 different, 1 sequence, 0 times, 1 bits\ndifferent c")
