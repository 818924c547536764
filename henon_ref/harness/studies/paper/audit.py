"""The audit of the paper's listing: what each of its mistakes does, alone and together.

:func:`audit` runs the paper's program with any set of its mistakes switched on, from the method done right
to the appendix as printed, and measures against the truth of the system that the set converges to.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pandas as pd
import sympy as sp
from numpy.typing import NDArray

from henon_ref.baselines.paper.listing import PARAMETERS
from henon_ref.baselines.paper.listing_variants import DEFECTS, VariantRun, run_variant
from henon_ref.harness.registry import solver
from henon_ref.harness.studies.paper.systems import FIG8_VALUES, fig8_equations, one_sided

Floats = NDArray[np.float64]

PRINTED_STEP = 1e-4
"""The step of the listing [s]."""
SMALL_STEP = 1e-5
"""A step ten times smaller, to see which way the durations go [s]."""
ORDER_STEPS = tuple(0.03 / 1.3**k for k in range(20))
"""Steps over which orders are fitted [s]; their ratios are no whole numbers, so no grid repeats."""
FITTED = 10
"""The fit takes this many of the smallest errors that are not rounding."""
ORDER_TRANSITIONS = 14
"""First transitions that orders are fitted to."""
ROUNDING = 1e-11
"""Errors below it [s] are rounding and are left out of the fit."""
CROSSING_START = (-0.0541, -1.0667)
"""Position and velocity at t = 0 on the orbit of Eq. (18) that only crosses, to four digits."""
LATE = 40.0
"""Sticks that start later [s] are on the attractor."""
SLIVER = 0.1
"""Sticks shorter than this [s] are not counted among the sticks of an orbit."""

ADDED = (
    "aliased_steps", "one_sided_release", "quantised_release", "frozen_forcing", "frozen_tangent",
    "rounded_sixth", "landing_sign", "exit_side",
)  # fmt: skip
"""The order in which :func:`audit` adds the mistakes up: first the two that make the orbit."""


@dataclass(frozen=True)
class Truth:
    """Transitions of a reading, by the Taylor reference."""

    times: Floats
    modes: NDArray[np.int64]
    skip: int
    """First changes of mode of the program that are none here: the paper's start is a tangent point, which
    Filippov's rule leaves at once, and the program by a release."""


def numbers() -> tuple[float, ...]:
    """m, k1, k2, mu0, vp, A, w of Fig. 8, rounded."""
    values = {symbol.name: value for symbol, value in FIG8_VALUES.items()}
    return tuple(float(values[name]) for name in PARAMETERS)


def limit_of(defects: Collection[str]) -> str:
    """What the program with these mistakes converges to for h -> 0."""
    if "aliased_steps" in defects:
        return "3 f, one-sided" if "one_sided_release" in defects else "none"
    return "f, one-sided" if "one_sided_release" in defects else "equations"


@cache
def truth_of(limit: str, start: tuple[float, float] | None = None) -> Truth:
    """Transitions of a limit system from the paper's start, or from another one in slip."""
    problem = {"equations": fig8_equations(), "f, one-sided": one_sided(1), "3 f, one-sided": one_sided(3)}[limit]
    if start is not None:
        exact = tuple(sp.Float(v, 17) for v in start)
        problem = replace(problem, initial=exact, initial_mode={})
    found = solver("henon").prepare(problem, rtol=1e-13)().transitions
    skip = int(start is None and limit == "equations")
    return Truth(np.array([t.time for t in found]), np.array([t.to_mode[0] for t in found]), skip)


def matched(run: VariantRun, truth: Truth, count: int | None = None) -> Floats | None:
    """Errors of the first ``count`` transitions (all without it), or None where the sequences differ."""
    times, modes = run.times[truth.skip :], run.modes[truth.skip :]
    want = len(truth.times) if count is None else min(count, len(truth.times))
    if run.status != "ok" or len(times) < want or (count is None and len(times) > want):
        return None
    if (modes[:want] != truth.modes[:want]).any():
        return None
    return np.asarray(times[:want] - truth.times[:want])


def order_of(defects: Collection[str], start: tuple[float, float] | None = None) -> float:
    """Order in h of the first transition times, fitted to their rms error against the limit's truth.

    NaN where there is no limit, or where too few steps have the limit's sequence of modes.
    """
    limit = limit_of(defects)
    if limit == "none":
        return float("nan")
    truth, found = truth_of(limit, start), []
    until = float(truth.times[ORDER_TRANSITIONS]) - 0.05
    for step in ORDER_STEPS:
        run = run_variant(defects, step=step, numbers=numbers(), start=start, until=until)
        errors = matched(run, truth, ORDER_TRANSITIONS)
        if errors is not None and (rms := float(np.sqrt(np.mean(errors**2)))) > ROUNDING:
            found.append((step, rms))
    if len(found) < FITTED // 2:
        return float("nan")
    steps, errors_of = zip(*found[-FITTED:], strict=True)
    return float(np.polyfit(np.log(steps), np.log(errors_of), 1)[0])


def durations(run: VariantRun) -> Floats:
    """Durations of the sticks on the attractor, slivers left out [s]."""
    lasting = np.diff(run.times)
    return np.asarray(lasting[(run.modes[:-1] == 0) & (run.times[:-1] > LATE) & (lasting > SLIVER)])


def _long_and_short(run: VariantRun) -> tuple[float, float]:
    """Mean duration of the longer and of the shorter kind of stick; NaN where there is none."""
    found = durations(run) if run.status == "ok" else np.empty(0)
    if not found.size:
        return float("nan"), float("nan")
    long = found > found.mean()
    return (
        (float(found[long].mean()), float(found[~long].mean())) if long.any() else (float(found.mean()), float("nan"))
    )


def sets() -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Every row of the audit: which family, which defect it is about, and all that are switched on."""
    yield "correct", "", ()
    for name in DEFECTS:
        yield "alone", name, (name,)
    for k, name in enumerate(ADDED, 1):
        yield "added", name, ADDED[:k]
    for name in DEFECTS:
        yield "left out", name, tuple(d for d in DEFECTS if d != name)


def audit(rows: Sequence[tuple[str, str, tuple[str, ...]]] | None = None) -> pd.DataFrame:
    """Run every row of :func:`sets` from the paper's start to t = 70 s.

    Parameters
    ----------
    rows : sequence, optional
        Some of the rows of :func:`sets`; all without it.

    Returns
    -------
    DataFrame
        ``set`` (correct, alone, added, left out), ``defect``, ``limit`` (what it converges to),
        ``status`` (ok, chatters, diverged), ``transitions`` and ``sticks`` (after t = 40 s, slivers
        under 0.1 s apart, in ``slivers``) at h = 1e-4, ``long_s`` and ``short_s`` (mean durations of the two
        kinds of stick) at h = 1e-4 and, ``_small``, at h = 1e-5, ``rms_error_s`` of all transitions at
        h = 1e-4 against the limit's truth (NaN where the sequence is another), ``order`` of the transition
        times in h from the paper's start, ``order_crossings`` from a start after which nothing sticks.
    """
    table = []
    for family, name, defects in rows if rows is not None else list(sets()):
        run = run_variant(defects, step=PRINTED_STEP, numbers=numbers())
        small = run_variant(defects, step=SMALL_STEP, numbers=numbers()) if run.status == "ok" else run
        limit = limit_of(defects)
        errors = None if limit == "none" else matched(run, truth_of(limit))
        sticking = (run.modes[:-1] == 0) & (run.times[:-1] > LATE)
        ended = run.status != "ok"
        long_s, short_s = _long_and_short(run)
        long_small, short_small = _long_and_short(small)
        table.append(
            {
                "set": family,
                "defect": name,
                "limit": limit,
                "status": run.status,
                "transitions": pd.NA if ended else len(run.times),
                "sticks": pd.NA if ended else len(durations(run)),
                "slivers": pd.NA if ended else int((sticking & (np.diff(run.times) <= SLIVER)).sum()),
                "long_s": long_s,
                "short_s": short_s,
                "long_s_small": long_small,
                "short_s_small": short_small,
                "rms_error_s": float("nan") if errors is None else float(np.sqrt(np.mean(errors**2))),
                "order": order_of(defects),
                "order_crossings": order_of(defects, CROSSING_START),
            }
        )
    return pd.DataFrame(table)
