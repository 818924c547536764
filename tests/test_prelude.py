"""What a worker that is begun ahead loads is all that a run of the reference asks numba for."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

SCRIPT = """
import sys
from henon_ref.score.prelude import prelude
prelude()
from henon_ref.henon.apart import FUNCTIONS
from henon_ref.henon.kernel import advance
def loaded():
    functions = [advance, *(function for function, types in FUNCTIONS.values())]
    return {f.__name__ for f in functions if f.overloads}, {m for m in sys.modules if m.startswith("henon_ref")}
before = loaded()
from henon_ref.henon.solvers import HENON_SOLVER
from henon_ref.score import runjob
from problems import make_problem
problem = make_problem("x", ["t - s"], {"s": "x"}, [0], 3)
HENON_SOLVER.prepare(problem, rtol=1e-9)()
assert loaded() == before, [now - then for now, then in zip(loaded(), before)]
assert before[0] == {"advance", "land", "polish", "sample"}
"""


def test_a_run_finds_everything_loaded() -> None:
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], cwd=Path(__file__).parent, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_the_command_begins_a_worker_before_it_imports_what_reads_cases() -> None:
    code = "import sys, henon_ref.compare; print([m for m in ('numpy', 'sympy', 'numba') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
