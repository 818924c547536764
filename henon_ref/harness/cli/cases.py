"""The command: what cases there are. Their files are read as YAML alone, their expressions are not."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from henon_ref.casefile.outline import Outline, outline
from henon_ref.casefile.shipped import located, shipped_folder, yaml_files
from henon_ref.commands.exit_status import DONE, command_of
from henon_ref.commands.typer_app import application, examples
from henon_ref.errors import CaseError
from henon_ref.harness.table import Table
from henon_ref.text import did_you_mean, listed

app = application()
HEADINGS = ("name", "readings", "states", "surfaces", "title", "tags")


@app.command(epilog=examples("cases", "cases --tag grazing", "cases hard my_cases"))
def main(
    folders: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Case files, or folders of them; those that come with the program if left out.",
            show_default=False,
            metavar="CASE",
        ),
    ] = None,
    tag: Annotated[
        list[str] | None,
        typer.Option(help="Only cases with this tag; given several times, with all of them.", metavar="TAG"),
    ] = None,
) -> int:
    """List cases: names, numbers of readings, states and surfaces, titles, tags."""
    found = [outline(file) for file in _files(folders or [shipped_folder()])]
    tags = dict.fromkeys(own for case in found for own in case.tags)
    for wanted in tag or ():
        if wanted not in tags:
            raise CaseError(f"no case has the tag '{wanted}'{did_you_mean(wanted, tags)}; tags: {listed(tags, 60)}")
    lines = [_line(case) for case in found if set(tag or ()) <= set(case.tags)]
    print(Table(HEADINGS, "lrrrll", lines).text)
    return DONE


command = command_of(app, "cases")


def _files(paths: Sequence[Path]) -> list[Path]:
    places = [located(path) for path in paths]
    return [file for place in places for file in (yaml_files(place) if place.is_dir() else [place])]


def _line(case: Outline) -> tuple[str, ...]:
    tags = ", ".join(case.tags)
    return case.name, str(case.readings), _span(case.states), _span(case.surfaces), case.title, tags


def _span(sizes: Sequence[int]) -> str:
    """A number, or the least and the largest of several readings."""
    least, largest = min(sizes), max(sizes)
    return str(least) if least == largest else f"{least} to {largest}"
