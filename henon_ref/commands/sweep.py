"""Command ``henon-ref sweep SWEEP.yaml``: reads a sweep file and writes Parquet files.

Options: ``[--out DIR] [--jobs N] [--dask ADDRESS] [--resume] [--plot]``. For the exit statuses see
:mod:`henon_ref.commands.exit_status`.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from henon_ref.commands import FLAG, application, examples, path_of, status_line
from henon_ref.commands.exit_status import DONE, command_of
from henon_ref.errors import CaseError
from henon_ref.workers import ONE_THREAD

if TYPE_CHECKING:
    from henon_ref.sweeps.plan import Plan
    from henon_ref.sweeps.storage import SweepFolder
    from henon_ref.sweeps.sweep import SweepTable

app = application()
Around = Callable[[Path], AbstractContextManager[None]]
"""Context around the writing of a sweep's folder: takes a lock, and afterwards writes the page."""


@app.command(
    epilog=examples("sweep belts.yaml", "sweep belts.yaml --jobs 8 --out results --plot", "sweep belts.yaml --resume")
)
def main(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(help="A sweep file (YAML).", show_default=False, metavar="SWEEP")],
    out: Annotated[
        Path, typer.Option(help="Folder for sweeps, a subfolder for each.", metavar="FOLDER", parser=path_of)
    ] = Path("out"),
    jobs: Annotated[
        int | None,
        typer.Option(help="Worker processes; if left out, the number of processors.", min=1, metavar="NUMBER"),
    ] = None,
    dask: Annotated[
        str | None, typer.Option(help="Run on a Dask cluster: its scheduler's address.", metavar="ADDRESS")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Keep finished chunks in the folder.", metavar=FLAG)] = False,
    plot: Annotated[bool, typer.Option("--plot", help="Draw the results, as SVG.", metavar=FLAG)] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress.", metavar=FLAG)] = False,
) -> int:
    """Run one system at many points, observe each run, and write the results as Parquet files."""
    from henon_ref.sweeps.plan import FIGURES
    from henon_ref.sweeps.storage import PAGE, SweepFolder
    from henon_ref.sweeps.sweep import done
    from henon_ref.sweeps.sweep_file import load_sweep
    from henon_ref.workers.executors import processors

    if not quiet:
        status_line.show(f"reading {file}")
    plan, around = load_sweep(file), context.obj or nullcontext
    folder, ended = out / plan.name, Counter[str]()
    with around(folder), _cluster(dask) as executor:
        status_line.clear()
        place = SweepFolder(folder, plan)
        place.begin(resume=resume, further=(PAGE, FIGURES) if plot else (PAGE,))
        for _, tables in done(plan, place, jobs=jobs or processors(), executor=executor, quiet=quiet):
            ended.update(tables.points["status"].tolist())
        counts = ", ".join(f"{count} {status}" for status, count in sorted(ended.items()))
        print(f"{folder}: {len(plan.points)} points, {counts}")
        if plot:
            _draw(place)
    return DONE


command = command_of(app, "sweep", kept="finished chunks are kept, --resume continues from them")


def program(arguments: Sequence[str] | None = None, around: Around | None = None) -> int:
    """Run the command and return its exit status."""
    for name, one in ONE_THREAD.items():  # as in the workers
        os.environ.setdefault(name, one)
    return command(arguments, obj=around)


@contextmanager
def _cluster(address: str | None) -> Iterator[Any]:
    """Yield a client of a Dask cluster, or None if no address is given."""
    if address is None:
        yield None
        return
    try:
        from distributed import Client
    except ImportError:
        raise CaseError("--dask needs the package distributed: pip install 'henon-ref[dask]'") from None
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:  # not an address, or the scheduler does not answer
        raise CaseError(f"no Dask scheduler answers at {address}: {error}") from None
    try:
        yield client
    finally:
        client.close()


def _draw(place: SweepFolder) -> None:
    from henon_ref.atomic_write import replace_file
    from henon_ref.figures import style
    from henon_ref.figures.sweeps import HEIGHT
    from henon_ref.sweeps.plan import FIGURES
    from henon_ref.sweeps.sweep import assembled

    folder = place.path / FIGURES
    folder.mkdir(exist_ok=True)
    for name, make in _pictures(place.plan, assembled(place.plan.points, list(place.finished()))):
        with style.figure(HEIGHT) as figure:
            figure.set_layout_engine("constrained")
            make(axes=figure.add_subplot())
            replace_file(folder / f"{name}.svg", style.image(figure))


def _pictures(plan: Plan, table: SweepTable) -> Iterator[tuple[str, Callable[..., Any]]]:
    """Yield names of figures and functions that draw them: a histogram of each number, section points over one swept
    name, observations over two."""
    from henon_ref.figures.sweeps import MOST_BASINS, basins, bifurcation, histogram, plane

    swept = list(plan.points.names)
    observed = [str(name) for name in table.columns if name not in (*swept, *plan.points.labels)]
    files = {name: name if name.isidentifier() else f"column{k}" for k, name in enumerate(observed)}
    numbers = [name for name in observed if table[name].dtype.kind in "iuf" and table[name].notna().any()]
    for name in numbers:
        yield f"histogram_{files[name]}", partial(histogram, table, name)
    if len(swept) == 1:
        for frame, points in table.frames.items():
            for state in plan.work.system.state:
                if state in points.columns:
                    yield f"bifurcation_{frame}_{state}", partial(bifurcation, table, swept[0], state, frame)
    if len(swept) == 2:
        x, y = swept
        for name in numbers:
            yield f"plane_{files[name]}", partial(plane, table, x, y, name)
        for name in observed:
            if name not in numbers and 0 < table[name].nunique() <= MOST_BASINS:
                yield f"basins_{files[name]}", partial(basins, table, x, y, name)
