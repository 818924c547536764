"""Shared by all tests: a system from text, so that a test reads like the problem it checks."""

from __future__ import annotations

import signal
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest
import sympy as sp
from commands import SOLVERS, Drawing
from fakes import CASE, statement

from henon_ref import registry
from henon_ref.model.system import TIME, FilippovSystem
from henon_ref.report import command as report_command
from henon_ref.score import truthjob
from henon_ref.trajectory import Problem


def make_problem(
    states: str,
    field: Sequence[str],
    surfaces: Mapping[str, str],
    initial: Sequence[str | int | float],
    until: str | int,
    *,
    start: str | int = 0,
    mode: Mapping[int, int] | None = None,
    valid: Sequence[str] = (),
) -> Problem:
    """A problem from trusted text (tests only; case files go through the whitelist)."""
    names = {name: sp.Symbol(name, real=True) for name in [*states.split(), *surfaces]}
    names["t"] = TIME

    def expression(text: str | int | float) -> sp.Expr:
        return sp.sympify(str(text), locals=names, rational=True)

    system = FilippovSystem(
        states=tuple(names[s] for s in states.split()),
        signs=tuple(names[s] for s in surfaces),
        surfaces=tuple(expression(h) for h in surfaces.values()),
        field=tuple(expression(f) for f in field),
        valid=tuple(expression(v) for v in valid),
    )
    return Problem(system, expression(start), tuple(expression(v) for v in initial), expression(until), mode or {})


@pytest.fixture
def problem():
    """The function :func:`make_problem`."""
    return make_problem


@pytest.fixture
def made_up_solvers(monkeypatch, tmp_path):
    """In place of real ones in the command, whose folder is a temporary one."""
    monkeypatch.setattr(report_command, "figure_job", lambda result, records: Drawing(result.reading.name))
    monkeypatch.setattr(report_command, "preload", lambda: None)
    monkeypatch.setattr(truthjob, "statement_of", statement)
    monkeypatch.setattr(registry, "solver", SOLVERS.__getitem__)
    monkeypatch.chdir(tmp_path)
    handler = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, handler)


@pytest.fixture
def made_up(tmp_path) -> Path:
    """A case file for them."""
    path = tmp_path / "made_up.yaml"
    path.write_text(CASE.format(name="made_up"))
    return path
