"""Hard cases through the protocol: each row is right, or says what happened, in bounded time."""

from __future__ import annotations

import pytest
from often import daily

import henon_ref
from henon_ref.baselines import cvode_c as build

pytestmark = pytest.mark.skipif(
    not (build.compiler() and build.library_version().startswith("6.")), reason="no C compiler, or no SUNDIALS 6"
)
RIGHT = {
    "blow_up": {"square", "slow", "tangent", "exponential"},
    "g_stays_zero": {"rest", "dead", "steady"},
    "nan_region": {"surface", "no_root", "field", "logarithm", "far"},
    "start_on_surface": set(),
    "running_dry": {"pumped"},
}
"""Case -> readings that CVODE from C gets right at 1e-9; empty: all of them."""


@pytest.mark.parametrize("name", daily(RIGHT, some=["start_on_surface", "running_dry"]))
def test_each_row_says_how_it_ended(name: str) -> None:
    case = henon_ref.load_case(f"hard/{name}")
    found = henon_ref.compare(case, solvers=["cvode-c-bdf"], tolerances=[1e-9], repeats=1, timeout=60.0, processes=1)
    rows = found.runs.set_index("reading")
    assert set(rows.index) == {reading.name for reading in case.readings}
    right = set(rows.index[rows["verdict"] == "right"])
    assert right >= (RIGHT[name] or set(rows.index)) - set(rows.index[rows["status"] == "unsupported"])
    for _, row in rows[rows["status"] != "ok"].iterrows():
        assert row["status_reason"]
