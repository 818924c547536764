"""One writer for the pages of all studies: files of numbers, figures, and a page that a template sets."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from henon_ref.atomic_write import replace_file
from henon_ref.harness.report.folder import INDEX
from henon_ref.harness.report.svg import svg
from henon_ref.harness.report.text.markdown import environment

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NONE: Mapping[str, Any] = MappingProxyType({})


def write(
    folder: Path,
    template: str,
    context: Mapping[str, Any],
    tables: Mapping[str, str] = NONE,
    figures: Mapping[str, Figure] = NONE,
) -> Path:
    """Write a study's files, and then the page that links to them; each is replaced as a whole.

    Parameters
    ----------
    folder : Path
        The study's own; made if it is not there.
    template : str
        Name of the page's template, without its ending.
    context : mapping
        What the template shows; ``origin``, a Provenance, where it says how the page was made.
    tables : mapping of str
        CSV text by file name.
    figures : mapping of Figure
        By file name; written as SVG.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    OSError
        Where the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in tables.items():
        replace_file(folder / name, text.encode())
    for name, figure in figures.items():
        replace_file(folder / name, svg(figure))
    text = environment().get_template(f"{template}.md.j2").render(context)
    replace_file(folder / INDEX, text.strip().encode() + b"\n")
    return folder / INDEX
