"""Functions that studies share: problems, runs of cases, new interpreters, fitted powers, figures and pages.

The study of causes is here, too, since it is only a page: the check of each cause is run while the page is written.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar
from urllib.parse import quote

import numpy as np

from henon_ref.atomic_write import replace_file
from henon_ref.casefile.case import Case, load_case
from henon_ref.casefile.files import shipped_folder
from henon_ref.figures import style
from henon_ref.harness.campaign.campaign import compare_all
from henon_ref.harness.campaign.comparison import Comparison
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.campaign.progress import ProgressLine
from henon_ref.harness.registry import program_versions
from henon_ref.harness.report.folder import INDEX, REPORT
from henon_ref.harness.report.rendering import environment
from henon_ref.harness.report.svg import svg
from henon_ref.harness.rows import RunRow
from henon_ref.harness.studies.study import StudyRequest, StudyResult
from henon_ref.jit.cache_folder import VARIABLE
from henon_ref.modes.problem import Problem
from henon_ref.text import markdown
from henon_ref.trajectory import Trajectory
from henon_ref.workers.machine import library_versions

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from henon_ref.baselines.causes import Cause

T = TypeVar("T")


def rows_of(cases: Sequence[Case], options: Options, observer: ProgressLine) -> list[RunRow]:
    """Run the cases; return the rows of ``runs.csv`` in the order of the cases."""
    found: dict[str, list[RunRow]] = {}

    def deliver(comparison: Comparison) -> None:
        found[comparison.case.name] = comparison.run_rows

    compare_all(cases, options, deliver, observer=observer)
    return [row for case in cases for row in found.get(case.name, [])]


def shipped_problem(case: str, reading: str = "default") -> Problem:
    return load_case(shipped_folder() / f"{case}.yaml").reading(reading).problem


def title(case: str, reading: str = "default") -> str:
    """Name of a reading on a page."""
    return case if reading == "default" else f"{case}, {reading}"


def report_link(case: str, reading: str = "default") -> str:
    """Link to the report of a case, or to one of its readings, from the page of a study."""
    anchor = "" if reading == "default" else f"#{quote(reading)}"
    return f"[{markdown(title(case, reading))}](../{quote(case)}/{REPORT}{anchor})"


def largest_time_difference(one: Trajectory, other: Trajectory) -> float:
    """Largest difference of the transition times of two runs [s]; infinite if their sequences differ."""
    if [t.to_mode for t in one.transitions] != [t.to_mode for t in other.transitions]:
        return math.inf
    return max((abs(a.time - b.time) for a, b in zip(one.transitions, other.transitions, strict=True)), default=0.0)


def in_fresh_process(function: Callable[..., T], *args: Any, cache: str | None = None) -> T:
    """Call a function in a new interpreter, in which nothing has been imported or compiled before.

    ``cache`` is the folder of its compiled code, by default that of this process.
    """
    with ProcessPoolExecutor(1, get_context("spawn"), _keep_code_in, (cache,)) as pool:
        return pool.submit(function, *args).result()


def _keep_code_in(folder: str | None) -> None:
    if folder is not None:
        os.environ[VARIABLE] = folder


def fitted(rows: Sequence[Any], x: str, y: str, since: float) -> str:
    """Fit column y ~ (column x)^power to rows with x >= ``since``; return the power with its standard error.

    The fit is by least squares of logarithms with equal weights. Two points have no error, and one has no power ("?").
    """
    from scipy.stats import linregress

    own = [row for row in rows if getattr(row, x) >= since]
    if len(own) < 2:
        return "?"
    found = linregress(*(np.log([getattr(row, column) for row in own]) for column in (x, y)))
    return f"{found.slope:.2f}" + (f" ± {found.stderr:.2f}" if len(own) > 2 else "")


def draw_line(axes: Axes, look: style.Line, points: Sequence[tuple[float, float]], label: str, **more: float) -> None:
    """Draw a solver's points on logarithmic axes."""
    axes.loglog(
        [x for x, _ in points], [y for _, y in points], ls=look.dashes, marker=look.marker, color=look.colour,
        lw=look.width, label=label, **more,
    )  # fmt: skip


def finish(figure: Figure, heading: str, words: str, with_legend: Iterable[Axes]) -> None:
    """Add legends above axes, the layout, and the description of the figure."""
    for axes in with_legend:
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)
    figure.set_layout_engine("constrained")
    style.describe(figure, heading, words)


def write(
    folder: Path,
    template: str,
    context: Mapping[str, Any],
    tables: Mapping[str, str] = {},
    figures: Mapping[str, Figure] = {},
) -> Path:
    """Write a study's files, then the page that links to them, and return its path; each file is replaced atomically.

    The folder is created if it does not exist; OSError if it cannot be written. ``template`` is a name without its
    suffix, ``context`` has the template's values, and ``tables`` (CSV text) and ``figures`` (written as SVG) are by
    file name.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in tables.items():
        replace_file(folder / name, text.encode())
    for name, figure in figures.items():
        replace_file(folder / name, svg(figure))
    text = environment().get_template(f"{template}.md.j2").render(context)
    replace_file(folder / INDEX, text.strip().encode() + b"\n")
    return folder / INDEX


def run_causes(request: StudyRequest) -> StudyResult:
    """Run the check of every cause and write the results."""
    from henon_ref.baselines.causes import CAUSES  # sets environment variables of libraries, which affect other studies

    versions = library_versions(tuple(cause.package for cause in CAUSES.values())) | program_versions()
    shown = [
        {"cause": cause, "version": versions[cause.package], "seen": _seen(cause, versions[cause.package])}
        for cause in CAUSES.values()
    ]
    return StudyResult(write(request.folder, "causes", {"causes": shown}))


def _seen(cause: Cause, version: str) -> str:
    """Result of the check, or a note that the library is not installed or does not behave as claimed."""
    from henon_ref.baselines.causes import ClaimError

    if not version:
        return "not installed here: not checked"
    try:
        return cause.check()
    except ClaimError as error:
        return f"**not as claimed with this version**: {error}"
