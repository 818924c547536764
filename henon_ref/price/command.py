"""What the command does, in order: check, the ladder, the pairs, the landings, the effects, the horizons, write."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from henon_ref.model.case import Case, parse_case
from henon_ref.price.effects import effect_costs
from henon_ref.price.growth import horizons
from henon_ref.price.ladder import run_ladder
from henon_ref.price.landings import landings, near_grazing
from henon_ref.price.operations import work
from henon_ref.price.page import Prices, write_page
from henon_ref.price.pairs import pairs
from henon_ref.price.states import sizes
from henon_ref.report.command import Shown, load_cases
from henon_ref.report.manifest import provenance
from henon_ref.report.write import check_writable
from henon_ref.score.journal import FILE
from henon_ref.score.options import Options
from henon_ref.trajectory import Problem
from henon_ref.truth.reference import Truth
from henon_ref.truth.settle import stored_truth
from henon_ref.truth.store import folder_of

FIG8 = """\
schema: 1
name: fig8_orbit
title: The motion of Fig. 8's `listing_limit`
system:
  state: [x1, x2]
  parameters: {m: 0.1, vp: 0.4, mu0: sqrt(3)/9, A: 4*sqrt(3)/3*sin(pi/18), w: 3*pi/2/1.2364, zs: 2*sqrt(3)/3*sin(pi/18)}
  surfaces: {s: x2 - vp}
  field:
    - 3*x2
    - 3*(-(x1 - A*sin(w*t)) + (x1 - A*sin(w*t))^3 - s*mu0/(1 + s*(x2 - vp)))/m
sliding:
  s:
    field: [vp, 0]
    release: [{when: x1 - A*sin(w*t) - zs, direction: rising, to: -1}]
initial: {t: 0, x1: -zs, x2: vp, mode: {s: 0}}
until: 70
"""
"""Fig. 8's `listing_limit`, whatever cases are asked for (a test holds it and the case file together)."""


def orbit_problem() -> Problem:
    """The periodic motion that long runs are measured on."""
    return parse_case(FIG8).readings[0].problem


def run(paths: Sequence[Path], out: Path, *, jobs: int, resume: bool) -> int:
    """Measure everything and write the page."""
    check_writable(out)
    cases = load_cases(paths)
    options = Options(processes=jobs, folder=out, resume=resume, keep_journals=True)
    with Shown() as shown:
        rows = run_ladder(cases, options, shown)
        timed, failed = pairs(cases, rows, options, shown)
    # What follows is timed in this process, with nothing else at work.
    orbit = orbit_problem()
    found = Prices(
        rows=rows,
        pairs=timed,
        failed=failed,
        landings=[*landings(cases, truths_of(cases)), *near_grazing()],
        work=work(orbit),
        effects=effect_costs(),
        growth=horizons(orbit),
        sizes=sizes(),
    )
    names = " ".join(str(path) for path in paths)
    page = write_page(found, provenance(f"python -m henon_ref.price {names}"), out)
    for case in cases:
        (out / case.name / FILE).unlink(missing_ok=True)
        if (out / case.name).is_dir():
            (out / case.name).rmdir()
    print(page)
    return 0


def truths_of(cases: Sequence[Case]) -> dict[tuple[str, str], Truth]:
    """The stored truths of the cases' readings."""
    found = {}
    for case in cases:
        for reading in case.readings:
            truth = stored_truth(case, reading, folder_of(case.path))
            if truth is not None:
                found[case.name, reading.name] = truth
    return found
