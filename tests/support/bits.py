"""Record the runs of the reference over the suite to the last bit, and compare two records.

    python -m tests.support.bits dump RECORD [--tolerances 1e-6,1e-9,1e-12,own] [--only fig8,hard] [--first]
                                             [--solver henon] [--deadline SECONDS]
    python -m tests.support.bits compare RECORD RECORD

``own`` is the tightest tolerance that a reading itself names; ``--first`` takes the first reading of each case alone.
With ``HENON_REF_CPU=haswell`` in front, the record is that of machine code for another processor
(:func:`henon_ref.jit.native_module.target`). ``compare`` ends with status 1 unless all runs have equal bits, and names
those that have not, the worst class first.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple

from henon_ref.casefile.case import Reading, load_case
from henon_ref.casefile.files import yaml_files
from henon_ref.errors import UnsupportedError
from henon_ref.harness.registry import fixed_step, solver
from henon_ref.jit.native_module import target
from henon_ref.trajectory import Trajectory, Transition

CASES = Path(__file__).parents[2] / "cases"
TOLERANCES = ("1e-6", "1e-9", "1e-12", "own")
DEADLINE = 60.0
"""A run that takes longer [s] says so (``timeout``); an emulated processor needs more (``--deadline``)."""

Record = dict[str, dict[str, Any]]
"""By ``case.reading@tolerance`` what the run came to, every double in hexadecimal."""


def record(
    tolerances: Sequence[str] = TOLERANCES,
    only: Collection[str] = (),
    name: str = "henon",
    *,
    first: bool = False,
    deadline: float = DEADLINE,
) -> Record:
    """Run the readings of the suite.

    What a solver does not support is left out.

    Parameters
    ----------
    tolerances : sequence of str
        Relative tolerances, or ``own``; for a solver with fixed steps it is the reading's own steps that count.
    only : collection of str
        Cases, or folders of cases, by name; none: all.
    name : str
        The solver.
    first : bool
        Of each case the first reading alone that the solver is to run.
    deadline : float
        Processor time that a run may take [s].
    """
    found: Record = {}
    for key, reading in _readings(only, name, first):
        if fixed_step(name):
            settings = [{"step": step} for step in reading.steps]
        else:
            chosen = {min(reading.tolerances) if t == "own" else float(t) for t in tolerances}
            settings = [{"rtol": rtol} for rtol in sorted(chosen, reverse=True)]
        for setting in settings:
            (size,) = setting.values()
            with suppress(UnsupportedError):
                run = solver(name).prepare(reading.problem, deadline=deadline, **setting)
                found[f"{key}@{size:g}"] = as_text(run())
    return found


def _readings(only: Collection[str], name: str, first: bool) -> Iterator[tuple[str, Reading]]:
    for path in yaml_files(CASES):
        if not only or path.stem in only or path.parent.name in only:
            case = load_case(path)
            readings = [each for each in case.readings if each.solvers is None or name in each.solvers]
            for reading in readings[:1] if first else readings:
                yield f"{case.name}.{reading.name}", reading


def as_text(run: Trajectory) -> dict[str, Any]:
    """Convert a run to JSON values."""
    return {
        "status": run.status,
        "transitions": [_transition(each) for each in run.transitions],
        "end": [run.end_time.hex(), [float(v).hex() for v in run.end_state], list(run.end_mode)],
        "counts": [int(count) for count in run.counts],
    }


def _transition(each: Transition) -> dict[str, Any]:
    return {
        "what": [each.kind, each.surface, list(each.from_mode), list(each.to_mode), each.landing],
        "time": [float(each.time).hex(), float(each.time_low).hex()],
        "state": [float(v).hex() for v in each.state],
    }


class Likeness(IntEnum):
    """Degrees of agreement of two runs; each includes those above it, except the first."""

    DIFFERENT = 0
    SEQUENCE = 1
    """The same status, transitions and modes."""
    TIMES = 2
    """And every time is the same double."""
    BITS = 3
    """And everything else: what rounding lost of the times, states, the end, landings, counts."""


class Compared(NamedTuple):
    """A run in two records, and their agreement."""

    likeness: Likeness
    time: float
    """Largest difference of a time [s]; 0 where the transitions are not the same."""
    state: float
    """Largest difference of a state at a transition; 0 where the transitions are not the same."""


def compared(one: dict[str, Any], other: dict[str, Any]) -> Compared:
    """Compare two runs."""
    if one == other:
        return Compared(Likeness.BITS, 0.0, 0.0)
    if _sequence(one) != _sequence(other):
        return Compared(Likeness.DIFFERENT, 0.0, 0.0)
    pairs = list(zip(one["transitions"], other["transitions"], strict=True))
    times = [(_number(a["time"][0]), _number(b["time"][0])) for a, b in pairs]
    lows = [(_number(a["time"][1]), _number(b["time"][1])) for a, b in pairs]
    late = [abs((a - b) + (c - d)) for (a, b), (c, d) in zip(times, lows, strict=True)]
    off = [abs(_number(p) - _number(q)) for a, b in pairs for p, q in zip(a["state"], b["state"], strict=True)]
    same = all(a == b for a, b in times)
    return Compared(Likeness.TIMES if same else Likeness.SEQUENCE, max(late, default=0.0), max(off, default=0.0))


def _sequence(run: dict[str, Any]) -> tuple[Any, ...]:
    return run["status"], run["end"][2], [each["what"][:4] for each in run["transitions"]]


def _number(text: str) -> float:
    return float.fromhex(text)


def compare(one: Record, other: Record) -> dict[str, Compared]:
    """Compare all runs of two records, least agreement first; a run in one record only is different."""
    missing = Compared(Likeness.DIFFERENT, 0.0, 0.0)
    found = {
        key: compared(one[key], other[key]) if key in one and key in other else missing
        for key in sorted(one.keys() | other.keys())
    }
    return dict(sorted(found.items(), key=lambda item: (item[1].likeness, -item[1].time)))


def report(found: dict[str, Compared]) -> str:
    """Number of runs by degree of agreement, then a line for each run whose bits differ."""
    counts = (f"{sum(each.likeness is kind for each in found.values())} {kind.name.lower()}" for kind in Likeness)
    lines = [f"{len(found)} runs: {', '.join(counts)}"]
    for key, each in found.items():
        if each.likeness is not Likeness.BITS:
            lines.append(f"{each.likeness.name.lower():9} {key}: time {each.time:.2g} s, state {each.state:.2g}")
    return "\n".join(lines)


def main() -> int:
    """Command line; see the docstring of the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    dump = commands.add_parser("dump")
    dump.add_argument("record", type=Path)
    dump.add_argument("--tolerances", default=",".join(TOLERANCES))
    dump.add_argument("--only", default="")
    dump.add_argument("--solver", default="henon")
    dump.add_argument("--first", action="store_true")
    dump.add_argument("--deadline", type=float, default=DEADLINE)
    beside = commands.add_parser("compare")
    beside.add_argument("records", type=Path, nargs=2)
    given = parser.parse_args()
    if given.command == "dump":
        only = [name for name in given.only.split(",") if name]
        runs = record(given.tolerances.split(","), only, given.solver, first=given.first, deadline=given.deadline)
        given.record.write_text(json.dumps({"target": list(target()), "runs": runs}, indent=1))
        print(f"{len(runs)} runs for {target()[0]}: {given.record}")
        return 0
    one, other = (json.loads(path.read_text())["runs"] for path in given.records)
    found = compare(one, other)
    print(report(found))
    return int(any(each.likeness is not Likeness.BITS for each in found.values()))


if __name__ == "__main__":
    sys.exit(main())
