"""A run of a system from Python loads what it needs: no harness, no form of case files, no figures, no tables."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

RUN = """
import sys
import henon_ref as hr
for system, initial, parameters in [{runs}]:
    run = hr.simulate(system, initial, until=3, parameters=parameters)
    assert run.success, run
print(*sorted(sys.modules))
"""
BELT = '["x", "v"], {"F": 1, "vb": 0.2}, {"s": "v - vb"}, ["v", "-x - F*s"]'
BALL = '["h", "v"], {"g": 10}, {"s": "h"}, ["v", "-g"], resets={"s": {"map": {"v": "-v/2"}, "priority": 1}}'
HOLD = (
    '{"s": {"field": ["v", "0"], "release": [{"when": "2 - x", "direction": "falling", "to": 1}], "entry": "inside"}}'
)
NOT_NEEDED = (
    "pydantic", "ruamel", "pandas", "pyarrow", "matplotlib", "jinja2", "typer", "rich", "heyoka", "sksundae",
    "henon_ref.harness", "henon_ref.baselines", "henon_ref.sweeps", "henon_ref.figures", "henon_ref.analysis",
    "henon_ref.commands", "henon_ref.enclosure", "henon_ref.workers",
    "henon_ref.system.scene", "henon_ref.system.connections", "henon_ref.casefile.case",
)  # fmt: skip


RUNS = (
    (BELT, {"x": 1, "v": 0}, None),
    (BELT, {"x": 1, "v": 0.5}, {"F": 2}),
    (BALL, {"h": 1, "v": 0}, None),
    (f"{BELT}, sliding={HOLD}", {"x": 1, "v": 0}, None),
)


def test_runs_load_nothing_that_they_do_not_need() -> None:
    runs = (f"(hr.System({system}), {initial}, {parameters})" for system, initial, parameters in RUNS)
    code = RUN.format(runs=", ".join(runs))
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300)
    loaded = found.stdout.split()
    assert [m for m in loaded if any(m == name or m.startswith(f"{name}.") for name in NOT_NEEDED)] == []
    if "numba" not in loaded:
        assert [m for m in loaded if m.startswith("scipy")] == []


SELDOM = (
    "henon_ref.taylor.llvm", "henon_ref.integrator.multiprecision_event", "henon_ref.integrator.precise_modes",
    "henon_ref.integrator.multiprecision_roots", "henon_ref.integrator.mode_changes", "henon_ref.integrator.endings",
    "henon_ref.modes.selection",
    "henon_ref.modes.held_groups", "henon_ref.modes.contact_problem", "henon_ref.modes.decoupled_contacts",
    "henon_ref.modes.coupled_contacts", "henon_ref.modes.held_contacts", "henon_ref.jit.ir_writer",
    "henon_ref.simulation.tables",
)  # fmt: skip


def test_a_run_of_what_was_compiled_before_writes_no_code() -> None:
    """Nor does it load what few runs need; of our own modules there are fewer than 70, of 11,500 lines."""
    runs = f"(hr.System({BELT}), {{'x': 1, 'v': 0.1}}, None)"
    for _ in range(2):
        code = RUN.format(runs=runs)
        found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300)
    loaded = found.stdout.split()
    assert set(loaded).isdisjoint(SELDOM)
    files = [
        Path(found.origin) for m in loaded if m.startswith("henon_ref") and (found := find_spec(m)) and found.origin
    ]
    assert len(files) < 70
    assert sum(len(file.read_text().splitlines()) for file in files) < 11_500


@pytest.mark.parametrize("name", [name for name in (*NOT_NEEDED, *SELDOM) if name.startswith("henon_ref.")])
def test_what_must_not_be_loaded_is_there(name: str) -> None:
    """A module that was renamed or merged into another is never loaded under its old name."""
    assert find_spec(name)
