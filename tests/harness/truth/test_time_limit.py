"""Time limits of a truth: an incomplete truth is not stored, and a progress message appears."""

from __future__ import annotations

import logging
import sys
from math import inf
from pathlib import Path

import pytest
from problems import HEAD, read_problem

from henon_ref.casefile.case import parse_case
from henon_ref.harness.campaign import progress
from henon_ref.harness.campaign.progress import TRUTH, ProgressLine
from henon_ref.harness.registry import solver
from henon_ref.harness.truth import compute
from henon_ref.harness.truth.multiprecision.route import multiprecision
from henon_ref.harness.truth.multiprecision.run import simulate
from henon_ref.harness.truth.reference import OUT_OF_TIME

LEVEL = """\
system: {state: [d], field: ["-2*sign(d)*sqrt(abs(d))"]}
initial: {t: 0, d: 1}
until: 3
"""
"""Flow through an orifice until the levels are equal (https://github.com/OpenModelica/OpenModelica/issues/12621)."""
BOUNCES = """\
system: {state: [x, v], surfaces: {s: v}, field: [v, "-x - s/10"]}
initial: {x: 5, v: 0}
until: 20
"""


def test_a_truth_ends_beside_a_kink_where_nothing_moves_on_as_henon_does() -> None:
    """d = (1 - t)^2 up to 1: the steps in front of it shrink one after the other, by the same part each."""
    problem = read_problem(LEVEL)
    found, own = simulate(problem, 128), solver("henon").prepare(problem, rtol=1e-9)()
    assert (found.status, found.instants, own.status) == ("failed", [], "failed")
    assert float(found.end_time) == pytest.approx(1.0, abs=1e-15)
    assert own.end_time == pytest.approx(1.0, abs=1e-9)
    assert "singular" in found.reason
    assert "singular" in own.reason


def test_a_truth_out_of_time_is_what_was_found_by_then() -> None:
    problem = read_problem(BOUNCES)
    whole = multiprecision(problem)
    cut = multiprecision(problem, seconds=0.0)
    assert len(whole.transitions) > 3
    assert (cut.status, len(cut.transitions) < len(whole.transitions)) == ("failed", True)
    assert cut.transitions == whole.transitions[: len(cut.transitions)]
    assert cut.reason == cut.undecided
    assert cut.reason.startswith(OUT_OF_TIME)


def test_a_truth_that_was_cut_short_is_not_kept(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(compute, "COMPUTED_SECONDS", 0.0)
    monkeypatch.setattr(compute, "PROOF_SECONDS", 0.0)
    monkeypatch.setattr(compute, "BARREN_SECONDS", 0.0)
    own = parse_case(HEAD + BOUNCES)
    cut = compute.truth_for(own, own.readings[0], folder=tmp_path)
    assert cut.reason.startswith(OUT_OF_TIME)
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setattr(compute, "COMPUTED_SECONDS", inf)
    whole = compute.truth_for(own, own.readings[0], folder=tmp_path)
    assert whole.status == "ok"
    assert list(tmp_path.rglob("*.json")) != []


def test_where_no_progress_is_shown_a_truth_that_takes_long_is_said_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(progress, "NOTICE_DELAY", -1.0)
    with caplog.at_level(logging.ERROR), ProgressLine(sys.stderr) as shown:
        shown.stage("truths", 1)
        shown.begun("level", f"default {TRUTH}")
        shown.tick()
        shown.tick()
        shown.truth("level default")
        shown.tick()
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert said.startswith("computing a truth that is not stored: level default truth")
