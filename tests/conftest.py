"""Fixtures that several files of tests share."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest
from commands import SOLVERS, Drawing
from fakes import CASE, statement
from problems import make_problem

from henon_ref import registry
from henon_ref.campaign import truth_job
from henon_ref.cli import compare_cases


@pytest.fixture
def problem():
    """The function :func:`make_problem`."""
    return make_problem


@pytest.fixture
def made_up_solvers(monkeypatch, tmp_path):
    """In place of real ones in the command, whose folder is a temporary one."""
    monkeypatch.setattr(compare_cases, "figure_job", lambda result, records: Drawing(result.reading.name))
    monkeypatch.setattr(compare_cases, "preload", lambda: None)
    monkeypatch.setattr(truth_job, "statement_of", statement)
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
