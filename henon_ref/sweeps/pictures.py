"""The pictures that the command draws of a sweep, by what its points and observations are."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from henon_ref.atomic_write import replace_file
from henon_ref.figures import style
from henon_ref.figures.sweeps import HEIGHT, MOST_BASINS, basins, bifurcation, histogram, plane
from henon_ref.sweeps.plan import FIGURES, Plan
from henon_ref.sweeps.storage import SweepFolder
from henon_ref.sweeps.table import SweepTable, assembled

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw(plan: Plan, folder: Path) -> list[Path]:
    """Draw a finished sweep: section points over one swept name, observations over two, a histogram of each number.

    Parameters
    ----------
    plan : Plan
    folder : Path
        That of the results; the pictures stand in its folder ``figures``.
    """
    table = assembled(plan.points, [tables for _, tables in SweepFolder(folder, plan).finished()])
    written = []
    (folder / FIGURES).mkdir(exist_ok=True)
    for name, make in _pictures(plan, table):
        with style.figure(HEIGHT) as figure:
            figure.set_layout_engine("constrained")
            make(figure.add_subplot())
            written.append(folder / FIGURES / f"{name}.svg")
            replace_file(written[-1], style.image(figure))
    return written


def _pictures(plan: Plan, table: SweepTable) -> Iterator[tuple[str, Callable[[Axes], Any]]]:
    """Name of each picture, and what draws it."""
    swept = list(plan.points.names)
    observed = [str(name) for name in table.columns if name not in (*swept, *plan.points.labels)]
    numbers = [name for name in observed if table[name].dtype.kind in "iuf" and table[name].notna().any()]
    for name in numbers:
        yield f"histogram_{_file(name, observed)}", partial(_drawn, histogram, table, name)
    if len(swept) == 1:
        for frame, points in table.frames.items():
            for state in plan.work.settings.system.state:
                if state in points.columns:
                    yield f"bifurcation_{frame}_{state}", partial(_drawn, bifurcation, table, swept[0], state, frame)
    if len(swept) == 2:
        for name in numbers:
            yield f"plane_{_file(name, observed)}", partial(_drawn, plane, table, *swept, name)
        for name in observed:
            if name not in numbers and 0 < table[name].nunique() <= MOST_BASINS:
                yield f"basins_{_file(name, observed)}", partial(_drawn, basins, table, *swept, name)


def _drawn(function: Callable[..., Any], *arguments: Any) -> Any:
    *own, axes = arguments
    return function(*own, axes=axes)


def _file(name: str, observed: Sequence[str]) -> str:
    """A file's name of a column's, which may be an expression."""
    return name if name.isidentifier() else f"column{observed.index(name)}"
