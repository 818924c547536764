"""Exponents and proven multipliers agree on every attracting periodic orbit of the suite.

Not among them: families (`zones_vanish` none, `late_powers`, `poincare_section`, `bouncing_spring`), orbits whose
surfaces are reached together, which nothing proves (`one_contact_twice`, `near_ties` together), those of a decay by
1e-12 a period (`zones_vanish` tiny), and readings with the equations of another one.
"""

from __future__ import annotations

import math

import pytest
from often import daily

import henon_ref as hr
from henon_ref.casefile.case import load_case
from henon_ref.enclosure.periodic_orbit import PeriodicOrbit

BEFORE = 20.37
"""Periods before the averages begin: not at an event, which many starts are."""
OVER = 30
"""Periods that they go over."""
PERIOD = "3091/1875"

ORBITS = [
    ("classic/nonstop_coulomb", None, "100*pi", "2*pi"),
    ("classic/rimless_wheel", None, 30, None),
    ("hard/forced_switching", None, "20*pi", "2*pi"),
    ("hard/static_entry", "from_below", 100, None),
    ("scenes/bouncing_table", None, 40, 1),
    ("scenes/impact_oscillator", "deep", "300*20*pi/27", "3*20*pi/27"),
    ("static_belt", None, 100, None),
    ("stribeck_belt", None, 100, None),
]
LONG_ONES = [  # slow; daily: the others
    ("scenes/friction_bstab", "stick_slip", 200, None),
    ("fig8", "equations", f"60*{PERIOD}", PERIOD),
    ("scenes/belt_leine", None, 100, None),
    ("scenes/bowed_string", None, "1/2", None),
    ("scenes/inelastic_ball", None, 10, 1),
    ("hard/units", "plain", 100, None),
    ("hard/stick_zones_merge", "eq13", 100, None),
    ("hard/static_entry", "written_out", 100, None),
    ("classic/relay_feedback", None, 300, None),
    ("fig8", "listing_limit", f"60*{PERIOD}", f"2*{PERIOD}"),
    ("hard/near_ties", "coupled", 200, None),
    ("hard/steep_friction", "falling", 100, None),
    ("hard/slider_with_stops", None, "201/1000", "1/250"),
    ("moving_belt", None, "400*pi", "10*pi"),
    ("rig_periodic", None, 3000, None),
    ("two_blocks", None, 400, None),
]


@pytest.mark.parametrize(
    ("name", "reading", "until", "period"),
    daily([*ORBITS, *LONG_ONES], some=ORBITS),
)
def test_exponents_are_those_of_the_proven_multipliers(
    name: str, reading: str | None, until: object, period: object
) -> None:
    case = load_case(name)
    problem = (case.reading(reading) if reading else case.readings[0]).problem
    system = hr.System.from_case(name, reading)
    initial = dict(zip(system.state, problem.initial, strict=True))
    how = {"start": problem.start, "mode": {system.model.sign_names[i]: s for i, s in problem.initial_mode.items()}}
    orbit = hr.periodic_orbit(system, initial, until=until, period=period, radius=1e-12, **how)
    length = float(orbit.period)
    found = hr.lyapunov_exponents(system, initial, discard=BEFORE * length, span=OVER * length, **how)
    assert found.status == "ok"
    proven = exponents(orbit, len(system.state), autonomous=period is None)
    for own, error, right in zip(found.exponents, found.standard_errors, proven, strict=True):
        assert own == right or own == pytest.approx(right, abs=3 * error + 1e-6)


def exponents(orbit: PeriodicOrbit, states: int, *, autonomous: bool) -> list[float]:
    """ln abs(multiplier) / period, -inf for what may be 0; along the orbit 0, which a return map leaves out."""
    sizes = [abs(m) for m in orbit.multipliers]
    rates = [-math.inf if size.contains(0) else float(size.log()) / float(orbit.period) for size in sizes]
    along = [0.0] if autonomous else []
    return sorted([*along, *rates, *[-math.inf] * states], reverse=True)[:states]
