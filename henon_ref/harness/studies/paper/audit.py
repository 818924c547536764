"""Audit of the appendix, Listing 1: effect of each of its mistakes, alone and together.

The paper's program is run with sets of its mistakes switched on, from the correct method to the appendix as printed.
Each set is compared with the truth of the system to which it converges.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.baselines.paper.listing import DEFECTS, PRINTED_STEP, VariantRun, run_variant
from henon_ref.figures import style
from henon_ref.figures.motion import Motion, portrait
from henon_ref.harness.result_files import rows_text
from henon_ref.harness.rows import Row
from henon_ref.harness.studies.paper.fig8 import LATE, PUBLISHED_DURATIONS, T, limit_sticks
from henon_ref.harness.studies.paper.systems import (
    Findings,
    fig8_equations,
    fig8_listing_limit,
    fitted_order,
    reference,
)
from henon_ref.harness.table import Table
from henon_ref.text import code

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

ORDER_STEPS = tuple(0.03 / 1.3**k for k in range(20))
"""Steps over which orders are fitted [s]; their ratios are not integers, so that no grid contains another one."""
ROUNDING = 1e-11
"""Errors below this [s] are rounding and are left out of the fit."""
CROSSING_START = (-0.0541, -1.0667)
"""Position and velocity at t = 0 on the orbit of Eq. (18) that has crossings only, to four digits."""
SETTLED = 40.0
"""Sticks that start later than this [s] are on the attractor."""
SLIVER = 0.1
"""Sticks shorter than this [s] are slivers; they do not count as sticks of an orbit."""
KINDS = (("longer stick", style.VERMILLION, "o", True), ("shorter stick", style.BLUE, "s", False))

ADDED = (
    "aliased_steps", "one_sided_release", "quantised_release", "frozen_forcing", "frozen_tangent",
    "rounded_sixth", "landing_sign", "exit_side",
)  # fmt: skip
"""Order in which the mistakes are added; the first two determine the orbit."""


@dataclass(frozen=True)
class AuditRow(Row):
    """Results of the program with a set of its mistakes, from the paper's start to t = 70 s."""

    set: str
    """correct, alone, added, left out."""
    defect: str
    """The mistake that is alone, added or left out."""
    limit: str
    """System to which the set converges for h -> 0."""
    status: str
    """ok, chatters, diverged."""
    transitions: int | None
    """Number of transitions at h = 1e-4; the next fields are for this step, too."""
    sticks: int | None
    """Number of sticks on the attractor, without slivers."""
    slivers: int | None
    long_s: float
    """Mean duration of the longer kind of stick; NaN if there is none."""
    short_s: float
    long_s_small: float
    """Mean duration of the longer kind of stick at h = 1e-5."""
    short_s_small: float
    rms_error_s: float
    """Root-mean-square error of all transition times; NaN if the sequence differs from that of the limit."""
    order: float
    """Order in h of the transition times from the paper's start."""
    order_crossings: float
    """Order in h of the transition times from :data:`CROSSING_START`."""


@dataclass(frozen=True)
class Truth:
    """Transitions of a reading, by the Taylor reference."""

    times: Floats
    modes: NDArray[np.int64]
    skip: int
    """Number of the program's first changes of mode that the truth does not have. The paper's start is a tangent point:
    Filippov's rule leaves it at once, and the program by a release."""


def limit_of(defects: Collection[str]) -> str:
    """Name of the system to which the program with these mistakes converges for h -> 0."""
    if "aliased_steps" in defects:
        return "3 f, one-sided" if "one_sided_release" in defects else "none"
    return "f, one-sided" if "one_sided_release" in defects else "equations"


@cache
def truth_of(limit: str, start: tuple[float, float] | None = None) -> Truth:
    """Transitions of a limit system from the paper's start, or from a given start in slip."""
    problem = fig8_equations() if limit == "equations" else fig8_listing_limit()
    if limit == "f, one-sided":
        system = problem.system
        problem = replace(problem, system=replace(system, field=tuple(f / 3 for f in system.field)))
    if start is not None:
        exact = tuple(sp.Float(v, 17) for v in start)
        problem = replace(problem, initial=exact, initial_mode={})
    found = reference(problem).transitions
    skip = int(start is None and limit == "equations")
    return Truth(np.array([t.time for t in found]), np.array([t.to_mode[0] for t in found]), skip)


def matched(run: VariantRun, truth: Truth, count: int | None = None) -> Floats | None:
    """Errors of the first ``count`` transitions (default: all); None if the sequences differ."""
    times, modes = run.times[truth.skip :], run.modes[truth.skip :]
    want = len(truth.times) if count is None else min(count, len(truth.times))
    if run.status != "ok" or len(times) < want or (count is None and len(times) > want):
        return None
    if (modes[:want] != truth.modes[:want]).any():
        return None
    return np.asarray(times[:want] - truth.times[:want])


def rms(errors: Floats | None) -> float:
    """Root mean square of errors; NaN if ``errors`` is None."""
    return np.nan if errors is None else float(np.sqrt(np.mean(errors**2)))


def order_of(defects: Collection[str], start: tuple[float, float] | None = None) -> float:
    """Order in h of the first 14 transition times, fitted to the ten smallest root-mean-square errors above rounding.

    NaN if the set has no limit, or too few steps give the limit's sequence of modes.
    """
    limit = limit_of(defects)
    if limit == "none":
        return np.nan
    truth = truth_of(limit, start)
    until = float(truth.times[14]) - 0.05
    runs = [(step, run_variant(defects, step=step, start=start, until=until)) for step in ORDER_STEPS]
    errors = [(step, rms(matched(run, truth, 14))) for step, run in runs]
    found = [(step, error) for step, error in errors if error > ROUNDING]
    return np.nan if len(found) < 5 else fitted_order(*zip(*found[-10:], strict=True))


def durations(run: VariantRun) -> Floats:
    """Durations of the sticks on the attractor, without slivers [s]; empty if the run chatters or diverges."""
    lasting = np.diff(run.times)
    found = lasting[(run.modes[:-1] == 0) & (run.times[:-1] > SETTLED) & (lasting > SLIVER)]
    return np.asarray(found if run.status == "ok" else found[:0])


def long_and_short(found: Floats) -> tuple[float, float]:
    """Mean durations of the longer and of the shorter kind of stick; NaN if there is none."""
    if not found.size:
        return np.nan, np.nan
    long = found > found.mean()
    if not long.any():
        return float(found.mean()), np.nan
    return float(found[long].mean()), float(found[~long].mean())


def sets() -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Yield each row of the audit as (set, defect, all defects that are switched on)."""
    yield "correct", "", ()
    for name in DEFECTS:
        yield "alone", name, (name,)
    for k, name in enumerate(ADDED, 1):
        yield "added", name, ADDED[:k]
    for name in DEFECTS:
        yield "left out", name, tuple(d for d in DEFECTS if d != name)


def audit_row(family: str, name: str, defects: Collection[str]) -> AuditRow:
    """Run one of the :func:`sets`; floats are rounded to 10 digits."""
    run, limit = run_variant(defects), limit_of(defects)
    ended = run.status == "ok"
    small = run_variant(defects, step=PRINTED_STEP / 10) if ended else run  # shows the trend of the durations
    errors = None if limit == "none" else matched(run, truth_of(limit))
    brief = (run.modes[:-1] == 0) & (run.times[:-1] > SETTLED) & (np.diff(run.times) <= SLIVER)
    counts = (len(run.times), len(durations(run)), int(brief.sum())) if ended else (None,) * 3
    measured = (
        *long_and_short(durations(run)), *long_and_short(durations(small)), rms(errors), order_of(defects),
        order_of(defects, CROSSING_START),
    )  # fmt: skip
    return AuditRow(family, name, limit, run.status, *counts, *(float(f"{value:.10g}") for value in measured))


def section() -> Findings:
    """Make the audit: tables, figure and claims."""
    rows = [audit_row(*own) for own in sets()]
    correct, last = rows[0], next(row for row in reversed(rows) if row.set == "added")
    frozen = next(row.order_crossings for row in rows if (row.set, row.defect) == ("alone", "frozen_forcing"))
    added = [(row.long_s, row.short_s) for row in rows if row.set == "added"]
    shift = max(float(np.ptp([value for value in own[1:] if value == value])) for own in zip(*added, strict=True))
    matches = (round(last.long_s, 4), round(last.short_s, 4)) == PUBLISHED_DURATIONS
    return Findings(
        {
            "as_printed": matches and abs(last.order - 1) < 0.3,
            "orders": abs(correct.order - 4) < 0.3 and abs(frozen - 1) < 0.1,
        },
        {
            "printed_order": last.order,
            "right": correct.order,
            "frozen": frozen,
            "shift": 1e3 * shift,
            "limit": [stick.duration for stick in limit_sticks()],
            "defects": Table(
                ("name", "mistake"), "ll", [(code(name), what) for name, what in DEFECTS.items()]
            ).markdown,
            "alone": audit_table([row for row in rows if row.set in ("correct", "alone")]).markdown,
            "added": audit_table([row for row in rows if row.set in ("correct", "added")], "+ ").markdown,
            "left_out": audit_table([row for row in rows if row.set == "left out"], "without ").markdown,
        },
        {"audit": draw_audit()},
        {"audit.csv": rows_text(AuditRow, rows)},
    )


def audit_table(rows: Iterable[AuditRow], beginning: str = "") -> Table:
    """Table of rows of the audit; ``beginning`` is the prefix of the mistakes' names."""
    lines = []
    for row in rows:
        numbers = [(row.long_s, ".5f"), (row.short_s, ".5f"), (row.long_s_small, ".5f"), (row.short_s_small, ".5f")]
        numbers += [(row.rms_error_s, ".1e"), (row.order, ".2f"), (row.order_crossings, ".2f")]
        name = f"{beginning}{code(row.defect)}" if row.defect else "none"
        counts = ["" if value is None else f"{value}" for value in (row.transitions, row.sticks)]
        cells = ["" if np.isnan(value) else format(value, form) for value, form in numbers]
        lines.append((name, row.limit, row.status, *counts, *cells))
    headings = (
        "mistake", "converges to", "status", "transitions", "sticks", "long [s]", "short [s]", "long, h/10",
        "short, h/10", "rms error [s]", "order", "order, crossings",
    )  # fmt: skip
    return Table(headings, "lllr", lines)


def draw_audit() -> Figure:
    """Draw phase portraits and durations as mistakes are added, and durations over the step."""
    stages = {
        "a   done right": (),
        "b   aliased": ADDED[:1],
        "c   and one-sided": ADDED[:2],
        "d   as printed": ADDED,
    }
    with style.figure(6.6) as figure:
        figure.set_layout_engine("constrained")
        above, below = cast(Any, figure.subfigures(2, 1, height_ratios=(5, 7)))
        for ax, (title, defects) in zip(above.subplots(1, len(stages), sharey=True), stages.items(), strict=True):
            run = run_variant(defects, until=LATE + 2 * T, path_from=LATE)
            path = run.path[::80]
            modes = run.modes[np.searchsorted(run.times, path[:, 0], side="right") - 1]
            motion = Motion(path[:, 0], path[:, 1:], tuple((mode,) for mode in modes.tolist()))
            portrait(ax, fig8_equations().system, motion, (0, 1), label="_")
            ax.set(xlabel="$x_1$ [m]", ylabel="", xlim=(-0.95, 0.75), ylim=(-1.9, 1.5))
            ax.set_title(title)
        above.axes[0].set_ylabel("$x_2$ [m/s]")
        left, right = below.subplots(1, 2)
        _draw_added(left)
        _draw_over_step(right)
    return figure


def _shifts(runs: Sequence[VariantRun], *, long: bool) -> list[Floats]:
    """Durations of a kind of stick minus that of the limit [ms]."""
    limit = limit_sticks()[0 if long else 1].duration
    found = [durations(run) for run in runs]
    return [1e3 * (own[(own > own.mean()) == long] - limit) for own in found]


def _draw_added(ax: Axes) -> None:
    places = np.arange(2, len(ADDED) + 1)
    runs = [run_variant(ADDED[:k]) for k in places]
    for label, colour, marker, long in KINDS:
        own = _shifts(runs, long=long)
        middle = np.array([d.mean() for d in own])
        spread = np.array([[m - d.min(), d.max() - m] for m, d in zip(middle, own, strict=True)]).T
        ax.errorbar(places, middle, yerr=spread, fmt=marker, color=colour, label=label, capsize=2, lw=1)
    ax.axhline(0, color=style.GREY, lw=0.8)
    ax.set_xticks(places, [name.replace("_", " ") for name in ADDED[1:]], rotation=40, ha="right")
    ax.set(ylabel="duration - limit [ms]", ylim=(-1.6, 1.25))
    ax.set_title("e   mistakes added, $h = 10^{-4}$ s")
    ax.legend(loc="upper left", ncols=2)


def _draw_over_step(ax: Axes) -> None:
    steps = [1e-3 / 10 ** (k / 6) for k in range(13)]
    runs = [run_variant(DEFECTS, step=step) for step in steps]
    for (label, colour, marker, long), limit, printed in zip(KINDS, limit_sticks(), PUBLISHED_DURATIONS, strict=True):
        means = [own.mean() for own in _shifts(runs, long=long)]
        ax.plot(steps, means, marker=marker, color=colour, lw=0.8, label=label)
        shift, above = 1e3 * (printed - limit.duration), 9 if long else -9
        ax.axhspan(shift - 0.05, shift + 0.05, color=style.GREY, alpha=0.35, lw=0)
        ax.annotate(f"{printed} s", (steps[-1], shift), (0, above), textcoords="offset points", va="center")
    ax.axvline(PRINTED_STEP, color=style.GREY, lw=0.8, ls=":")
    ax.axhline(0, color=style.GREY, lw=0.8)
    ax.set(xscale="log", xlabel="$h$ [s]", ylabel="duration - limit [ms]", ylim=(-2.7, 2.7))
    ax.set_title("f   as printed, over the step")
    ax.legend(loc="lower left")
