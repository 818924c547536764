"""The page of the price list: prices in front, then what they are made of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from henon_ref.columns import RUN_COLUMNS, Row
from henon_ref.price import effects
from henon_ref.price.effects import Step
from henon_ref.price.figures import COUNTS, draw_growth, draw_ladder, draw_sizes
from henon_ref.price.growth import Horizon
from henon_ref.price.ladder import paid_after, relative_costs
from henon_ref.price.landings import Landed
from henon_ref.price.operations import Work
from henon_ref.price.pairs import RIVALS
from henon_ref.price.states import Size
from henon_ref.report import style
from henon_ref.report.csvfiles import csv_text
from henon_ref.report.manifest import Provenance
from henon_ref.report.markdown import environment
from henon_ref.report.ranking import LEVELS, name, number, prices, readings_of
from henon_ref.report.tables import Table, wall
from henon_ref.report.words import duration, setting
from henon_ref.report.write import replace_file
from henon_ref.rivals.duel import COLUMNS
from henon_ref.rivals.page import bound

PAGE = "README.md"
RUNS = "price.csv"
GROWTH = "growth.svg"
SIZES = "states.svg"
PAIRS = "pairs.csv"


@dataclass(frozen=True)
class Prices:
    """Everything that was measured."""

    rows: Sequence[Row]
    pairs: Sequence[Row]
    failed: Sequence[str]
    """Pairs that could not be timed, and why."""
    landings: Sequence[Landed]
    work: Work
    effects: Sequence[Step]
    growth: Sequence[Horizon]
    sizes: Sequence[Size]


def write_page(found: Prices, origin: Provenance, folder: Path) -> Path:
    """Write rows, figures and page.

    Raises
    ------
    OSError
        Where the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    replace_file(folder / RUNS, csv_text(RUN_COLUMNS, found.rows).encode())
    replace_file(folder / PAIRS, csv_text(COLUMNS, found.pairs).encode())
    sections = []
    for (case, reading), rows in readings_of(found.rows).items():
        figures = []
        for count in COUNTS:
            file = f"{case}_{reading}_{count}.svg"
            style.save(draw_ladder(rows, count), folder / file)
            figures.append((COUNTS[count], file))
        title = case if reading == "default" else f"{case}, {reading}"
        sections.append({"title": title, "figures": figures, "table": price_table(rows).markdown})
    style.save(draw_growth(found.growth), folder / GROWTH)
    style.save(draw_sizes(found.sizes), folder / SIZES)
    text = (
        environment()
        .get_template("price.md.j2")
        .render(
            whole=whole_table(found.rows).markdown,
            rivals=rival_table(found.pairs).markdown,
            pairs=PAIRS,
            failed=found.failed,
            sections=sections,
            landings=landing_table(found.landings).markdown,
            effects=effect_table(found.effects).markdown,
            growth=growth_table(found.growth).markdown,
            growth_figure=GROWTH,
            sizes=size_table(found.sizes).markdown,
            sizes_figure=SIZES,
            work=found.work,
            of_peak=f"{100 * found.work.rate / found.work.peak:.0f} %",
            gigaflops=f"{found.work.rate / 1e9:.2g}",
            peak=f"{found.work.peak / 1e9:.2g}",
            runs=len(found.rows),
            rerun=origin.rerun,
            machine=origin.machine_text,
            commit=origin.commit[:12],
        )
    )
    replace_file(folder / PAGE, text.strip().encode() + b"\n")
    return folder / PAGE


def whole_table(rows: Sequence[Row]) -> Table:
    """Solvers by their geometric mean cost over all readings, for every level."""
    costs = {level: relative_costs(rows, level) for level in LEVELS}
    order = sorted(
        {s for own in costs.values() for s in own}, key=lambda s: min(c.get(s, math.inf) for c in costs.values())
    )
    lines = [(f"`{s}`", *(f"{costs[level][s]:.3g}" if s in costs[level] else "" for level in LEVELS)) for s in order]
    return Table(("solver", *(f"{level} digits" for level in LEVELS)), "l" + "r" * len(LEVELS), lines)


def rival_table(found: Sequence[Row]) -> Table:
    """`henon`'s time over that of others, for the same digits of the worst transition, reading by reading."""
    ratios: dict[tuple[str, str, str], dict[str, float]] = {}
    for row in found:
        own = ratios.setdefault((str(row["case"]), str(row["reading"]), bound(row["digits"])), {})
        own[str(row["rival"])] = number(row, "ratio")
    lines = []
    for (case, reading, digits), own in ratios.items():
        cells = [f"{own[rival]:.2g}" if rival in own else "" for rival in RIVALS]
        lines.append((case if reading == "default" else f"{case}, {reading}", digits, *cells))
    return Table(("reading", "digits", *(f"`{rival}`" for rival in RIVALS)), "lr" + "r" * len(RIVALS), lines)


def size_table(found: Sequence[Size]) -> Table:
    """Time of a run and of a step over the number of states."""
    lines: list[tuple[str, ...]] = []
    for states in dict.fromkeys(own.states for own in found):
        own = {size.solver: size for size in found if size.states == states}
        first = own["henon"]
        cells = [
            f"{duration(size.wall_s)}; {duration(size.per_step_s)}; {duration(size.prepare_s)}"
            if size.agrees else "other transitions"
            for size in own.values()
        ]  # fmt: skip
        ratio = f"{own['heyoka'].ratio:.2g}" if own["heyoka"].agrees else ""
        lines.append((f"{states}", f"{first.transitions}", *cells, ratio))
    solvers = dict.fromkeys(size.solver for size in found)
    return Table(
        ("states", "transitions", *(f"`{s}`" for s in solvers), "`henon` / `heyoka`"),
        "rr" + "r" * len(solvers) + "r",
        lines,
    )


def price_table(rows: Sequence[Row]) -> Table:
    """The cheapest solver for so many digits, the next one, and when its compiling has paid for itself."""
    lines: list[tuple[str, ...]] = []
    for price in prices(rows):
        if price.row is None:
            continue
        row, other = price.row, price.next_row
        paid = None if other is None else paid_after(row, other)
        lines.append(
            (
                f"{price.digits}",
                f"`{name(row)}`",
                setting(row["rtol"], row["step_s"]),
                wall(row),
                duration(number(row, "compile_s")) if row["compile_s"] else "",
                "" if other is None else f"`{name(other)}`, {wall(other)}",
                "" if paid is None else f"{math.ceil(paid)}",
            )
        )
    headings = ("digits", "cheapest", "at", "wall time (IQR)", "compiling", "next", "paid for after runs")
    return Table(headings, "rlrrrlr", lines)


def landing_table(found: Sequence[Landed]) -> Table:
    """Evaluations, time and error of the three landings."""
    lines = []
    for case, reading in dict.fromkeys((own.case, own.reading) for own in found):
        own = [one for one in found if (one.case, one.reading) == (case, reading)]
        title = case if reading == "default" else f"{case}, {reading}"
        cells = []
        for one in own:
            error = "another sequence" if math.isnan(one.error_s) else f"{one.error_s:.1e} s"
            cells.append(f"{one.evaluations:.1f}; {duration(one.wall_s)}; {error}")
        lines.append((title, *cells))
    solvers = list(dict.fromkeys(one.solver for one in found))
    return Table(("reading", *(f"`{solver}`" for solver in solvers)), "l" + "r" * len(solvers), lines)


def effect_table(steps: Sequence[Step]) -> Table:
    """What every effect costs, and what it costs to carry those that are not asked for."""
    headings = (
        "body", "effect added", "operations", "carried at zero", "time a step", "carried at zero", "ratio",
        "to one by hand",
    )  # fmt: skip
    return Table(headings, "llrrrrrr", effects.table(steps))


def growth_table(found: Sequence[Horizon]) -> Table:
    """Cost, memory and accuracy over the horizon."""
    lines: list[tuple[str, ...]] = [
        (
            f"{own.until:.0e} s",
            f"{own.transitions}",
            duration(own.wall_s),
            duration(own.per_transition_s),
            f"{own.grown:.1f} MiB",
            "not settled yet" if math.isnan(own.stick_error_s) else f"{own.stick_error_s:.1e} s",
        )
        for own in found
    ]
    return Table(
        ("horizon", "transitions", "wall time", "a transition", "memory", "last sticks' error"), "rrrrrr", lines
    )
