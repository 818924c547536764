"""What a solver costs for so many digits, as a multiple of ``henon``'s time: read from the pairs that were timed."""

from __future__ import annotations

import math
from collections.abc import Sequence

from henon_ref.report.text.paired_times import FIRST, SECOND, PairRow
from henon_ref.report.text.ranking import reaching, readings_of
from henon_ref.rows import RunRow
from henon_ref.studies.price.ladder import TIMEOUT


def costs(found: Sequence[PairRow], reading: tuple[str, str], digits: int) -> dict[str, float]:
    """Each solver's time over that of ``henon``, for so many digits in one reading."""
    rows = [row for row in found if row.problem == reading and row.digits == digits]
    return {row.rival: 1.0 / row.ratio for row in rows} | ({FIRST: 1.0} if rows else {})


def mean_costs(found: Sequence[PairRow], digits: int) -> dict[str, float]:
    """Geometric mean of these over all readings that another solver gets to so many digits, too.

    Solvers that do not get there in every one are left out.
    """
    readings = dict.fromkeys(row.problem for row in found if row.digits == digits)
    each = [costs(found, reading, digits) for reading in readings]
    common = [solver for solver in dict.fromkeys(s for own in each for s in own) if all(solver in own for own in each)]
    return {solver: math.exp(sum(math.log(own[solver]) for own in each) / len(each)) for solver in common}


def mean_own_cost(found: Sequence[PairRow], digits: int) -> float | None:
    """The same mean for heyoka's own calls alone; None where they are not known in every reading of its mean."""
    own = [row.own_ratio for row in found if (row.rival, row.digits) == (SECOND, digits)]
    known = [ratio for ratio in own if ratio]
    if not known or len(known) < len(own) or SECOND not in mean_costs(found, digits):
        return None
    return math.exp(sum(map(math.log, known)) / len(known))


def why_not(rows: Sequence[RunRow], solver: str, digits: int) -> str:
    """Why a solver has no mean cost for so many digits: what keeps it from them in the first reading where it fails."""
    for own in readings_of(rows).values():
        if reaching([row for row in own if row.solver != solver], digits):
            ladder = [row for row in own if row.solver == solver]
            if not reaching(ladder, digits):
                return _failure(ladder)
    return ""


def _failure(ladder: Sequence[RunRow]) -> str:
    ends = {"unsupported": "unsupported", "unavailable": "not installed"}
    if any(row.status == "timeout" for row in ladder):
        return f"over {TIMEOUT:g} s"
    return next((ends[row.status] for row in ladder if row.status in ends), "not reached")
