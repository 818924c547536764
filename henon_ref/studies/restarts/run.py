"""The study of how libraries are restarted: its readings, its libraries, and their runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from henon_ref import registry
from henon_ref.campaign.options import Observer, Options
from henon_ref.casefile.case import Case
from henon_ref.report.files.manifest import Provenance
from henon_ref.studies.restarts.page import FOLDER, write_page
from henon_ref.studies.runs import rows_of

CASES: dict[str, tuple[str, ...]] = {
    "fig8": ("listing_limit",),
    "start_on_surface": (),
    "restart_at_root": (),
    "free_coulomb": (),
    "leaving_slide": (),
    "quick_restick": (),
    "g_stays_zero": (),
    "two_roots_ballistic": ("d1e1", "d1e3"),
    "two_contacts": (),
    "two_roots": ("beside_a_touch",),
    "odd_orders": ("behind_a_crossing",),
    "steep_friction": ("viscous",),
}
"""Cases that start on a surface, or leave one again and again, or come back to it at once, or after a crossing where
their guard is flat, or whose first steps are stiff; their readings (all)."""
TOLERANCES = (1e-6, 1e-9)


def chosen(cases: Sequence[Case]) -> list[Case]:
    """The cases of the experiment, with the readings that belong to it."""
    found = []
    for case in cases:
        if case.name in CASES:
            wanted = CASES[case.name] or [reading.name for reading in case.readings]
            readings = tuple(reading for reading in case.readings if reading.name in wanted)
            found += [replace(case, readings=readings)] if readings else []
    return found


def run_restarts(
    cases: Sequence[Case], options: Options, origin: Provenance, out: Path, observer: Observer
) -> Path | None:
    """Run the experiment on those of its cases that are there, and write its page.

    Parameters
    ----------
    cases : sequence of Case
    options : Options
        As for the cases themselves: solvers, limits and resuming are taken from it.
    origin : Provenance
    out : Path
        Folder of the reports.
    observer : Observer

    Returns
    -------
    Path or None
        The page; None where none of the cases is there, or no solver that restarts a library was asked for.
    """
    found = chosen(cases)
    names = options.solvers or registry.default_names()
    libraries = [name for name in names if isinstance(name, str) and registry.restart_of(name)]
    if not found or not libraries:
        return None
    folder = out / FOLDER
    changed = replace(
        options,
        solvers=tuple(dict.fromkeys(map(registry.base_name, libraries))),
        restarts=registry.RESTARTS,
        tolerances=TOLERANCES,
        timed=False,
        folder=folder,
    )
    rows = [row for own in rows_of(found, changed, observer).values() for row in own]
    return write_page(rows, origin, folder)
