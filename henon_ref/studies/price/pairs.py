"""``henon`` against every other solver, compiled callbacks included: each pair in turn, for the same digits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from henon_ref.campaign.options import Observer, Options
from henon_ref.casefile.case import Case
from henon_ref.columns import Row
from henon_ref.report.text.paired_times import FIRST
from henon_ref.report.text.ranking import LEVELS, by_solver, name, number, reaching, readings_of
from henon_ref.studies.price.ladder import TIMEOUT, sampled
from henon_ref.studies.rivals.duel import RIVAL_SAMPLES, SAMPLES, Duel, fight
from henon_ref.studies.rivals.match import matches

SECONDS = 4.0
"""Time that the runs of a pair may take."""
FEWEST = 3
"""Rounds at least, however long they take."""


def pairs(
    cases: Sequence[Case], rows: Sequence[Row], options: Options, observer: Observer, seconds: float = SECONDS
) -> tuple[list[Row], list[str]]:
    """Time the pairs on every reading that both solve; their rows, and what could not be timed.

    Parameters
    ----------
    cases : sequence of Case
    rows : sequence of Row
        The ladder's: they tell which settings get how many digits.
    options : Options
        Processes and memory are taken from it.
    observer : Observer
    seconds : float
        Time that the runs of a pair may take.
    """
    by_reading = readings_of(rows)
    rivals = [solver for solver in by_solver(rows) if solver != FIRST]
    duels = {
        case.name: [
            Duel(case.name, reading.name, reading.problem, found, seconds, TIMEOUT, fewest=FEWEST)
            for reading in case.readings
            for rival in rivals
            if (found := tuple(matches(by_reading.get((case.name, reading.name), []), {rival: (rival,)}, LEVELS)))
        ]
        for case in cases
    }
    return fight(duels, options, observer)


def samples_of(found: Sequence[Row]) -> list[Row]:
    """The raw samples behind the pairs' ratios: two rows a pair."""
    rows = []
    for row in found:
        settings: tuple[Row, Row] = (
            {"solver": FIRST, "rtol": row["rtol"], "step_s": None},
            {"solver": row["rival"], "rtol": row["rival_rtol"], "step_s": row["rival_step_s"]},
        )
        for own, column in zip(settings, (SAMPLES, RIVAL_SAMPLES), strict=True):
            rows.append(sampled({**row, **own}, row[column]))  # type: ignore[arg-type]
    return rows


def costs(found: Sequence[Row], reading: tuple[str, str], digits: int) -> dict[str, float]:
    """Each solver's time over that of ``henon``, for so many digits in one reading."""
    rows = [row for row in found if (row["case"], row["reading"]) == reading and row["digits"] == digits]
    return {str(row["rival"]): 1.0 / number(row, "ratio") for row in rows} | ({FIRST: 1.0} if rows else {})


def mean_costs(found: Sequence[Row], digits: int) -> dict[str, float]:
    """Geometric mean of these over all readings that somebody else gets to so many digits, too.

    Solvers that do not get there in every one are left out.
    """
    readings = dict.fromkeys((str(row["case"]), str(row["reading"])) for row in found if row["digits"] == digits)
    each = [costs(found, reading, digits) for reading in readings]
    common = [solver for solver in dict.fromkeys(s for own in each for s in own) if all(solver in own for own in each)]
    return {solver: math.exp(sum(math.log(own[solver]) for own in each) / len(each)) for solver in common}


def why_not(rows: Sequence[Row], solver: str, digits: int) -> str:
    """Why a solver has no mean cost for so many digits: what keeps it from them in the first reading where it fails."""
    for own in readings_of(rows).values():
        if reaching([row for row in own if name(row) != solver], digits):
            ladder = [row for row in own if name(row) == solver]
            if not reaching(ladder, digits):
                return _failure(ladder)
    return ""


def _failure(ladder: Sequence[Row]) -> str:
    ends: Mapping[object, str] = {"unsupported": "unsupported", "unavailable": "not installed"}
    if any(row["status"] == "timeout" for row in ladder):
        return f"over {TIMEOUT:g} s"
    return next((ends[row["status"]] for row in ladder if row["status"] in ends), "not reached")
