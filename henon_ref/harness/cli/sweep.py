"""The command: a sweep file in, Parquet files out.

``henon-ref sweep SWEEP.yaml [--out DIR] [--jobs N] [--dask ADDRESS] [--resume] [--plot]``. For the exit
statuses see :mod:`henon_ref.commands.exit_status`.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from henon_ref.commands import status_line
from henon_ref.commands.exit_status import DONE, exit_status, parsed
from henon_ref.commands.typer_app import FLAG, application, examples
from henon_ref.errors import CaseError
from henon_ref.harness.cli.compare import ONE_THREAD

if TYPE_CHECKING:
    from henon_ref.sweeps.storage import SweepFolder

app = application()
KEPT = "finished chunks are kept, --resume goes on from them"
PATIENCE = 10
"""Seconds that a cluster is waited for."""


@app.command(
    epilog=examples("sweep belts.yaml", "sweep belts.yaml --jobs 8 --out results --plot", "sweep belts.yaml --resume")
)
def main(
    file: Annotated[Path, typer.Argument(help="A sweep file (YAML).", show_default=False, metavar="SWEEP")],
    out: Annotated[Path, typer.Option(help="Folder of the sweeps, each in one of its name.", metavar="FOLDER")] = Path(
        "out"
    ),
    jobs: Annotated[
        int | None,
        typer.Option(help="Worker processes; as many as there are processors if left out.", min=1, metavar="NUMBER"),
    ] = None,
    dask: Annotated[
        str | None, typer.Option(help="Run on a Dask cluster: its scheduler's address.", metavar="ADDRESS")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Keep chunks that are finished in the folder.", metavar=FLAG)
    ] = False,
    plot: Annotated[bool, typer.Option("--plot", help="Draw the results, as SVG.", metavar=FLAG)] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress.", metavar=FLAG)] = False,
) -> int:
    """Run one system at many points, observe each run, and write the results as Parquet files."""
    from henon_ref.harness.report.folder import check_folder, locked
    from henon_ref.harness.report.html.sweep_page import write_sweep_page
    from henon_ref.sweeps.manifest import files_of, manifest_of
    from henon_ref.sweeps.plan import FIGURES
    from henon_ref.sweeps.storage import PAGE, SweepFolder
    from henon_ref.sweeps.sweep_file import load_sweep
    from henon_ref.workers.executors import processors

    if not quiet:
        status_line.show(f"reading {file}")
    sweep = load_sweep(file)
    folder = out / sweep.name
    check_folder(folder)
    further = (PAGE, FIGURES) if plot else (PAGE,)
    with _cluster(dask) as executor, locked([folder]):
        status_line.clear()
        place = SweepFolder(folder, sweep.plan)
        files = files_of(sweep.plan, name=sweep.name, title=sweep.title, source=sweep.source)
        place.begin(files, manifest_of(sweep.plan), resume=resume, further=further)
        _run(place, jobs=jobs or processors(), executor=executor, quiet=quiet)
        if plot:
            from henon_ref.sweeps.pictures import draw

            draw(sweep.plan, folder)
        write_sweep_page(folder)
    return DONE


def program(arguments: Sequence[str] | None = None) -> int:
    """Run the command; the exit status."""
    for name in ONE_THREAD:  # as the workers have it
        os.environ.setdefault(name, "1")
    return exit_status(lambda: int(parsed(app, arguments, name="sweep")), name="sweep", arguments=arguments, kept=KEPT)


def _run(place: SweepFolder, *, jobs: int, executor: Any, quiet: bool) -> None:
    from henon_ref.sweeps.progress import shown
    from henon_ref.sweeps.sweep import done

    points, ended = len(place.plan.points), Counter[str]()
    with shown(points, quiet=quiet) as progress:
        for _, tables in done(place.plan, place, jobs=jobs, executor=executor, progress=progress):
            ended.update(tables.points["status"].tolist())
    print(f"{place.path}: {points} points, {', '.join(f'{count} {status}' for status, count in sorted(ended.items()))}")


@contextmanager
def _cluster(address: str | None) -> Iterator[Any]:
    """A client of a Dask cluster, where one is wanted."""
    if address is None:
        yield None
        return
    try:
        from distributed import Client
    except ImportError:
        raise CaseError("--dask needs the package distributed: pip install 'henon-ref[dask]'") from None
    try:
        client = Client(address, timeout=PATIENCE)
    except (OSError, ValueError) as error:  # what is no address, and a scheduler that does not answer
        raise CaseError(f"no Dask scheduler answers at {address}: {error}") from None
    try:
        yield client
    finally:
        client.close()
