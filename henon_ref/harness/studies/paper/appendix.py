"""The appendix: the audit of Listing 1 as a table, a figure and a page of text."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pandas as pd

from henon_ref.baselines.paper.listing_variants import DEFECTS, VariantRun, run_variant
from henon_ref.figures import style
from henon_ref.harness.report.svg import svg
from henon_ref.harness.studies.paper.audit import ADDED, PRINTED_STEP, audit, durations, numbers
from henon_ref.harness.studies.paper.claims import Claim, Section, checked, picture
from henon_ref.harness.studies.paper.curves import thinned
from henon_ref.harness.studies.paper.fig8 import BELT, LATE, PUBLISHED_DURATIONS, T, readings, sticks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STEPS = tuple(1e-3 / 10 ** (k / 6) for k in range(13))
"""Steps at which the listing as printed is drawn [s]."""

_HEADINGS = {
    "alone": "Each mistake alone, on the method done right",
    "added": "Added one by one, from the method done right to the appendix as printed",
    "left out": "The appendix as printed with one mistake put right",
}


def section(folder: Path) -> Section:
    """The audit; writes its table and draws its figure."""
    table = audit()
    table.to_csv(folder / "audit.csv", index=False, float_format="%.10g")
    (folder / "audit.svg").write_bytes(svg(draw_audit()))
    caption = (
        "Where 1.1746 and 0.4161 come from. a to d: two periods of the forcing on the attractor, as mistakes are "
        "added. e: durations at h = 1e-4 against those of the limit for small steps, mistakes added from left to right "
        "(bars: range over the sticks of a run). f: the appendix as printed over its step; the grey bands are the "
        "paper's digits."
    )
    added = table[table["set"] == "added"]
    shift = 1e3 * max(float(np.ptp(added[key].dropna()[1:])) for key in ("long_s", "short_s"))
    long, short = limit_durations()
    story = _STORY.format(shift=shift, long=long, short=short)
    parts = [_OPENING, picture(folder, "audit.svg", caption), story, _defects_text()]
    parts += [f"#### {heading}\n\n{_table(table, name)}" for name, heading in _HEADINGS.items()]
    parts.append(_LEGEND)
    return Section("The appendix: an audit of Listing 1", "\n".join(parts), _claims(table))


def _claims(table: pd.DataFrame) -> tuple[Claim, ...]:
    last = table[table["set"] == "added"].iloc[-1]
    orders = table.set_index(["set", "defect"])
    frozen = float(orders.loc[("alone", "frozen_forcing"), "order_crossings"])
    right = float(orders.loc[("correct", ""), "order"])
    matches = tuple(round(v, 4) for v in (last["long_s"], last["short_s"])) == PUBLISHED_DURATIONS
    return (
        checked(
            "Appendix",
            "Listing 1, h = 1e-4, 633000 steps, results kept from step 600000 on",
            matches and abs(float(last["order"]) - 1) < 0.3,
            "Run as printed (with its counter advanced, which the listing never does) it gives the paper's digits. "
            f"Its transition times converge with order {float(last['order']):.2f}, to those of another system than "
            "Eq. (18).",
        ),
        checked(
            "Appendix",
            "4th-order Runge-Kutta",
            abs(right - 4) < 0.3 and abs(frozen - 1) < 0.1,
            f"Order {right:.2f} with all mistakes put right; {frozen:.2f} as soon as the forcing is frozen over a "
            "step, which is how the listing has it.",
            corrected=True,
        ),
    )


def _defects_text() -> str:
    rows = "\n".join(f"| `{name}` | {what} |" for name, what in DEFECTS.items())
    return f"The mistakes that change what is computed:\n\n| name | mistake |\n|---|---|\n{rows}\n\n{_PROSE}"


def _table(table: pd.DataFrame, family: str) -> str:
    lines = [
        "| mistake | converges to | status | transitions | sticks | long [s] | short [s] | long, h/10 | short, h/10 "
        "| rms error [s] | order | order, crossings |",
        "|---|---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    rows = table[table["set"] == family]
    if family != "left out":
        rows = pd.concat([table[table["set"] == "correct"], rows])
    for row in rows.to_dict("records"):
        name = f"`{row['defect']}`" if row["defect"] else "none"
        name = f"+ {name}" if family == "added" and row["defect"] else name
        name = f"without {name}" if family == "left out" else name
        cells = [
            name,
            row["limit"],
            row["status"],
            _count(row["transitions"]),
            _count(row["sticks"]),
            *(_number(row[key], "{:.5f}") for key in ("long_s", "short_s", "long_s_small", "short_s_small")),
            _number(row["rms_error_s"], "{:.1e}"),
            *(_number(row[key], "{:.2f}") for key in ("order", "order_crossings")),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _count(value: object) -> str:
    return "" if pd.isna(value) else str(value)


def _number(value: float, form: str) -> str:
    return "" if np.isnan(value) else form.format(value)


def draw_audit() -> Figure:
    """Portraits as the mistakes add up, durations as they add up, and durations over the step."""
    stages = ((), ADDED[:1], ADDED[:2], ADDED)
    titles = ("a   done right", "b   aliased", "c   and one-sided", "d   as printed")
    with style.figure(6.6) as figure:
        figure.set_layout_engine("constrained")
        above, below = cast(Any, figure.subfigures(2, 1, height_ratios=(5, 7)))
        portraits = above.subplots(1, len(stages), sharey=True)
        for ax, defects, title in zip(portraits, stages, titles, strict=True):
            until = LATE + 2 * T
            run = run_variant(defects, step=PRINTED_STEP, numbers=numbers(), until=until, path_from=LATE)
            _draw_portrait(ax, run)
            ax.set_title(title)
        portraits[0].set_ylabel("$x_2$ [m/s]")
        left, right = below.subplots(1, 2)
        _draw_added(left)
        _draw_over_step(right)
    return figure


def _draw_portrait(ax: Axes, run: VariantRun) -> None:
    path = run.path
    on = np.abs(path[:, 2] - BELT) < 1e-12
    held = on & (np.roll(on, 1) | np.roll(on, -1))  # one sample alone on the belt is a crossing
    ax.axhline(BELT, color=style.GREY, lw=0.8, zorder=1)
    drawn = thinned(np.where(on, 0.0, path[:, 2] - BELT), 80)
    ax.plot(path[drawn, 1], path[drawn, 2], color=style.BLUE, lw=0.9)
    ax.plot(np.where(held, path[:, 1], np.nan)[drawn], path[drawn, 2], color=style.BLACK, lw=2.4)
    ax.set(xlabel="$x_1$ [m]", xlim=(-0.95, 0.75), ylim=(-1.9, 1.5))


def limit_durations() -> tuple[float, float]:
    """Durations of the two sticks of the listing's limit [s]."""
    found = sticks(readings().limit, 0)
    return found[0].duration, found[-1].duration


def _draw_added(ax: Axes) -> None:
    places = np.arange(2, len(ADDED) + 1)
    kinds = (("longer stick", style.VERMILLION, "o", 1), ("shorter stick", style.BLUE, "s", 0))
    found = [durations(run_variant(ADDED[:k], step=PRINTED_STEP, numbers=numbers())) for k in places]
    for (label, colour, marker, long), limit in zip(kinds, limit_durations(), strict=True):
        own = [1e3 * (d[(d > d.mean()) == bool(long)] - limit) for d in found]
        middle = np.array([d.mean() for d in own])
        spread = np.array([[m - d.min(), d.max() - m] for m, d in zip(middle, own, strict=True)]).T
        ax.errorbar(places, middle, yerr=spread, fmt=marker, color=colour, label=label, capsize=2, lw=1)
    ax.axhline(0, color=style.GREY, lw=0.8)
    ax.set_xticks(places, [name.replace("_", " ") for name in ADDED[1:]], rotation=40, ha="right")
    ax.set(ylabel="duration - limit [ms]", ylim=(-1.6, 1.25))
    ax.set_title("e   mistakes added, $h = 10^{-4}$ s")
    ax.legend(loc="upper left", ncols=2)


def _draw_over_step(ax: Axes) -> None:
    runs = [durations(run_variant(DEFECTS, step=step, numbers=numbers())) for step in STEPS]
    kinds = (("longer stick", style.VERMILLION, "o", 1), ("shorter stick", style.BLUE, "s", 0))
    for (label, colour, marker, long), limit, printed in zip(
        kinds, limit_durations(), PUBLISHED_DURATIONS, strict=True
    ):
        means = [1e3 * (d[(d > d.mean()) == bool(long)].mean() - limit) for d in runs]
        ax.plot(STEPS, means, marker=marker, color=colour, lw=0.8, label=label)
        shift = 1e3 * (printed - limit)
        ax.axhspan(shift - 0.05, shift + 0.05, color=style.GREY, alpha=0.35, lw=0)
        ax.annotate(
            f"{printed} s", (STEPS[-1], shift), xytext=(0, 9 if long else -9), textcoords="offset points", va="center"
        )
    ax.axvline(PRINTED_STEP, color=style.GREY, lw=0.8, ls=":")
    ax.axhline(0, color=style.GREY, lw=0.8)
    ax.set(xscale="log", xlabel="$h$ [s]", ylabel="duration - limit [ms]", ylim=(-2.7, 2.7))
    ax.set_title("f   as printed, over the step")
    ax.legend(loc="lower left")


_OPENING = """\
The paper's numbers are those of its program, and the program is not a method for its equations. Two of its mistakes
together make another system, which sticks twice every two periods; the others, and the step of 1e-4, make the last
digits.

"""

_STORY = """\
- **Done right** (order 4, both ends of a zone tested) Eq. (18) settles on an orbit that only crosses.
- **Aliasing** makes the slip three times as fast, but neither time nor the stick. Where y' lies between vp and 3 vp the
  stick's z falls while the slip's rises, so that a stick which ends at the lower tangent point is taken up again at
  once: late in the run such sticks, a few steps long, fill the time, the more of them the smaller the step. Its
  transitions have no limit.
- **One-sided release** takes that away by never looking at the lower end. The two together converge to the reading
  `listing_limit`; either alone does not stick like Fig. 8.
- The remaining mistakes move the durations by up to {shift:.1f} ms at h = 1e-4. One of them, the wrong exit side, needs
  the wrong sign of the landing step: without it the run turns back and forth at a release and time stands still; with
  it the state is pushed off the surface, to the right side after all.
- The last printed digit of each duration is the step's: the limit has {long:.7f} and {short:.7f}.

"""

_PROSE = """\
Mistakes that do not: the loop's counter is never advanced; only two of the three stick zones are looked at for the
start; outside all zones the zone's index is -1, which in Python is the last tangent point and not an error; `solve` is
called before it is defined, and has a number (`20`) among its parameters; `numpy.float`, `<>` and `print` without
brackets are of Python 2.

"""

_LEGEND = """\
*Converges to*: the system whose truth the errors and orders are taken against (`equations`: Eq. (18) with Filippov's
sliding; `f` or `3 f`, one-sided: that slip field, and a stick left at the upper tangent point only; none: no limit).
*Status* chatters: the changes of mode never end. *Transitions* to t = 70 s (the release that the run may start with
included), *sticks* after t = 40 s and longer than
0.1 s, durations of the two kinds of stick (mean), then the same at a step ten times smaller. *Rms error* of all
transitions at h = 1e-4. *Order* of the first 14 transition times in h, from the paper's start, and (*crossings*) from
a start after which nothing sticks. An empty cell: there is none, or the sequence of modes is not the limit's.
"""
