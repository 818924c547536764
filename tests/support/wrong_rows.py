"""Rows of wrong runs and of missed transitions, for the patterns of causes."""

from __future__ import annotations

from henon_ref.harness.rows import RunRow, TransitionRow


def run_row(**values: object) -> RunRow:
    names = {"case": "made_up", "reading": "default", "solver": "scipy-rk45", "rtol": 1e-6, "atol": 1e-6}
    return RunRow(**names | {"status": "wrong", "verdict": "solver defect", "missed": 2, "spurious": 0} | values)


def missed(source: str, target: str, **values: object) -> TransitionRow:
    own = {"from_mode": source, "to_mode": target, "surface": "h", "kind": "crossing", "outcome": "missed"}
    return TransitionRow("made_up", "default", "", None, None, 0, **own | {"graze_distance": 1e-4} | values)


PAIR = [missed("-", "+"), missed("+", "-")]
