"""Frames of a run: columns, types and values are those that rows give."""

from __future__ import annotations

import pandas as pd
import pytest

import henon_ref as hr
from henon_ref.simulation.tables import COLUMNS, STICK_COLUMNS

BELT = hr.System(["x", "v"], {"F": 1, "vb": 0.2}, {"s": "v - vb"}, ["v", "-x - F*s/(1 + 3*s*(v - vb))"])


@pytest.mark.parametrize("until", [0.01, 1.5, 14, 60])
def test_frames_are_those_of_rows(until: float) -> None:
    run = hr.simulate(BELT, {"x": 1, "v": 0}, until=until)
    found = [
        (t.time, t.kind, BELT.model.sign_names[t.surface], f"s={t.from_mode[0]:+d}", f"s={t.to_mode[0]:+d}", *t.state)
        for t in run.trajectory.transitions
    ]
    rows = [tuple(cell.replace("s=+0", "s=0") if isinstance(cell, str) else cell for cell in row) for row in found]
    numbers = dict.fromkeys(("time_s", "x", "v"), float)
    wanted = pd.DataFrame(rows, columns=[*COLUMNS, "x", "v"]).astype(numbers)
    pd.testing.assert_frame_equal(run.transitions, wanted, check_exact=True, check_column_type=False)
    sticks = [(s[0], s[1], "s") for s in zip(run.sticks["start_s"], run.sticks["duration_s"], strict=True)]
    wanted = pd.DataFrame(sticks, columns=list(STICK_COLUMNS)).astype({"start_s": float, "duration_s": float})
    pd.testing.assert_frame_equal(run.sticks, wanted, check_exact=True)
    assert len(run.sticks) == (0 if until < 5 else len(run.sticks))
