"""Extremes of long expressions: two dozen ordinary terms are answered, in seconds."""

from __future__ import annotations

import numpy as np
import pytest

import henon_ref as hr

TERMS = range(1, 25)


def test_extremes_of_two_dozen_quotients() -> None:
    """A block slides to rest: x = t - F t^2/2, v = 1 - F t; the values are those on a fine grid of t."""
    block = hr.System(["x", "v"], {"F": 0.5}, {"s": "v"}, ["v", "-F*s"])
    of = " + ".join(f"sin({k}*x*v)/(1 + x^{k})" for k in TERMS)
    observed = [hr.observe.extremes(of, name="sum")]
    table = hr.sweep(block, {"x": 0, "v": 1}, until=9, grid={"F": [0.5, 1]}, observe=observed, jobs=1)
    assert table.status.tolist() == ["ok", "ok"]
    for force, least, largest in zip(table.F, table.min_sum, table.max_sum, strict=True):
        t = np.linspace(0, 1 / force, 200_001)
        x, v = t - force * t**2 / 2, 1 - force * t
        values = sum(np.sin(k * x * v) / (1 + x**k) for k in TERMS)
        assert (least, largest) == pytest.approx((values.min(), values.max()), abs=1e-7)
