"""What a report says of the periodic orbit that a case names: how far the exact run's last period is from it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from henon_ref.campaign.results import ReadingResult
from henon_ref.casefile.expected import Orbit
from henon_ref.report.text.formats import error, listing, significant
from henon_ref.score.reference import Expected
from henon_ref.score.sticks import published_partners, sticks


def orbit_sentences(result: ReadingResult) -> list[str]:
    """The orbit that a reading names, and the last period of its exact run beside it."""
    orbit, expected = result.reading.orbit, result.expected
    if orbit is None or expected is None or not (orbit.sticks or orbit.crossings):
        return []
    told = [f"The case names a periodic orbit of period {significant(float(orbit.period), 11)} s"]
    compared = []
    if orbit.sticks:
        told.append(f"sticks of {listing([f'{value}' for value in orbit.sticks])} s")
        compared.append(_sticks(orbit, expected, result.reading.measure_after))
    if orbit.crossings:
        told.append(f"crossings at {listing([f'{value}' for value in orbit.crossings])} s modulo the period")
        compared.append(_crossings(orbit, expected))
    return [" with ".join([told[0], " and ".join(told[1:])]) + ".", *compared]


def _sticks(orbit: Orbit, expected: Expected, after: float) -> str:
    """How far the last sticks of each kind are from the orbit's."""
    found = [stick.duration for stick in sticks(expected.transitions, start=expected.start, after=after)]
    named = [float(value) for value in orbit.sticks]
    last = dict(zip(published_partners(found, named), found, strict=True))  # of each kind the last one
    if not last:
        return "The exact run has no stick in the measured window."
    off = _off([last[value] - value for value in named if value in last])
    return f"The exact run's last {'sticks are' if len(last) > 1 else 'stick is'} off it by {off} s."


def _crossings(orbit: Orbit, expected: Expected) -> str:
    """How far the last crossings are from the orbit's, modulo the period."""
    period = float(orbit.period)
    times = [event.time for event in expected.transitions if event.kind == "crossing"][-len(orbit.crossings) :]
    if not times:
        return "The exact run has no crossing."
    nearest = [
        min((math.remainder(time - float(value), period) for time in times), key=abs) for value in orbit.crossings
    ]
    return f"The exact run's last {'crossings are' if len(nearest) > 1 else 'crossing is'} off it by {_off(nearest)} s."


def _off(differences: Sequence[float]) -> str:
    return listing([error(difference) for difference in differences])
