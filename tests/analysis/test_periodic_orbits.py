"""Periodic orbits through jumps of the state, against closed forms; and what is said where there is none."""

from __future__ import annotations

from collections.abc import Mapping

import pytest
import sympy as sp

import henon_ref as hr
from henon_ref.enclosure.balls import enclose
from henon_ref.precision import working_precision

NEURON = hr.System(["u"], {"I": 1.5}, {"s": "1 - u"}, ["I - u"], resets={"s": {"map": {"u": "0"}}})
"""Integrate and fire (Lapicque, 1907): the period is ln(I/(I - 1))."""
ADAPTIVE = hr.System(
    ["u", "w"], {}, {"s": "1 - u"}, ["2 - u - w", "-w/10"], resets={"s": {"map": {"u": "0", "w": "w + 1/20"}}}
)
WHEEL = hr.System.from_case("classic/rimless_wheel")
THERMOSTAT = hr.System(
    state=["T", "on"],
    parameters={"k": 0.3},
    surfaces={"low": "T - 19", "high": "21 - T"},
    field=["-k*(T - 10) + 20*k*on", "0"],
    resets={"low": {"map": {"on": "1"}}, "high": {"map": {"on": "0"}}},
)
DOSES = hr.System(
    ["c", "tau"], {"k": 0.3}, {"d": "2 - tau"}, ["-k*c", "1"], resets={"d": {"map": {"tau": 0, "c": "c + 1"}}}
)
DOSES_IN_TIME = hr.System(["c"], {"k": 0.3}, {"d": "sin(pi*t)"}, ["-k*c"], resets={"d": {"map": {"c": "c + 1"}}})
BOUNCER = hr.System(["x", "v"], {}, {"s": "x + 1/2"}, ["v", "-x + v/10"], resets={"s": {"map": {"v": "-3*v/5"}}})


@pytest.mark.parametrize(
    ("system", "initial", "how", "period", "largest"),
    [
        (NEURON, {"u": 0}, {"until": 50}, "log(3)", None),
        (WHEEL, {"th": "s - a", "w": "w0"}, {"until": 30}, None, "1/2"),
        (WHEEL, {"th": "s - a", "w": "1.2*w0"}, {"until": 30}, None, "1/2"),
        (THERMOSTAT, {"T": 20, "on": 1}, {"until": 20}, "2*log(11/9)/(3/10)", None),
        (DOSES, {"c": 0, "tau": 0}, {"until": 60}, "2", "exp(-3/5)"),
        (DOSES, {"c": 0, "tau": 0}, {"until": 20}, "2", "exp(-3/5)"),
        (DOSES_IN_TIME, {"c": 0}, {"until": "60.5", "period": 2}, "2", "exp(-3/5)"),
        (DOSES_IN_TIME, {"c": 0}, {"until": 60, "period": 2}, "2", "exp(-3/5)"),
    ],
)
def test_an_orbit_through_resets_is_proven(
    system: hr.System, initial: Mapping[str, object], how: dict[str, object], period: str | None, largest: str | None
) -> None:
    orbit = hr.periodic_orbit(system, initial, **how)
    assert max(float(b.rad()) for b in (orbit.period, *orbit.state)) < 1e-40
    with working_precision(orbit.bits):
        assert period is None or orbit.period.overlaps(enclose(sp.sympify(period)))
        if largest is None:
            assert all(abs(m) < 1e-40 for m in orbit.multipliers)
        else:
            assert orbit.multipliers[0].real.overlaps(enclose(sp.sympify(largest)))
            assert all(abs(m) < 1e-40 for m in orbit.multipliers[1:])


def test_a_wheel_walks_with_the_speed_that_energy_tells() -> None:
    """Just after an impact w^2 is 4 sin(a) sin(s) cos(2 a)^2 / sin(2 a)^2 (McGeer, Int. J. Robot. Res. 9, 1990)."""
    orbit = hr.periodic_orbit(WHEEL, {"th": "s - a", "w": "w0"}, until=30)
    with working_precision(orbit.bits):
        assert orbit.state[1].overlaps(enclose(WHEEL.model.numeric(sp.Symbol("w0", real=True))))


@pytest.mark.parametrize("until", [300, 100, 40])
def test_an_orbit_between_impacts_is_proven_however_far_the_run_still_is(until: float) -> None:
    """Of equal speeds of impact; by t = 40 the run is a hundredth off, and 1e-9 only after t = 150."""
    orbit = hr.periodic_orbit(BOUNCER, {"x": 1, "v": 0}, until=until)
    assert float(orbit.period) == pytest.approx(4.61443776327499, abs=1e-13)
    assert float(orbit.state[1]) == pytest.approx(0.425609, abs=1e-6)
    with working_precision(orbit.bits):  # a turn multiplies areas by e^(T/10), an impact by 9/25
        assert orbit.multipliers[0].real.overlaps((orbit.period / 10).exp() * 9 / 25)


def test_an_adaptive_neuron_fires_with_what_its_adaptation_decays_to() -> None:
    """w falls by e^(-T/10) between spikes and rises by 1/20 at one, for both of the runs."""
    near, far = (hr.periodic_orbit(ADAPTIVE, {"u": 0, "w": 0}, until=until) for until in (60, 400))
    assert near.period.overlaps(far.period)
    with working_precision(near.bits):
        left = (-near.period / 10).exp()
        assert (near.state[1] * (1 - left)).overlaps(enclose(sp.Rational(1, 20)))


def test_a_clock_that_is_set_back_is_the_period_of_the_drive() -> None:
    values, start = {"w": 0.7}, {"x": 0, "v": 0}
    drive = hr.System(["x", "v"], values, {"s": "v"}, ["v", "-x - 0.8*s + 1.3*cos(w*t)"])
    clock = hr.System(
        ["x", "v", "p"],
        values,
        {"s": "v", "c": "2*pi - p"},
        ["v", "-x - 0.8*s + 1.3*cos(p)", "w"],
        resets={"c": {"map": {"p": "p - 2*pi"}}},
    )
    own = hr.periodic_orbit(drive, start, until=300, period="2*pi/w", radius=1e-20)
    orbit = hr.periodic_orbit(clock, {**start, "p": 0}, until=300, radius=1e-20)
    assert orbit.period.overlaps(own.period)
    for m in own.multipliers:
        assert any(abs(m - other) < 1e-15 for other in orbit.multipliers)


@pytest.mark.parametrize(
    ("field", "surface"),
    [(["v", "-x"], "x"), (["v", "-x"], "x - 0.3"), (["v", "-sin(x)"], "x"), (["v", "-x - x^3"], "v")],
)
def test_a_family_of_orbits_is_one_clear_error(field: list[str], surface: str) -> None:
    with pytest.raises(hr.HenonRefError, match="no isolated orbit"):
        hr.periodic_orbit(hr.System(["x", "v"], {}, {"s": surface}, field), {"x": 1, "v": 0}, until=100)


@pytest.mark.parametrize(("field", "until"), [(["v", "-x - v/10"], 100), (["v", "-x + v/10"], 50), (["1", "0"], 10)])
def test_what_does_not_repeat_itself_is_said_to(field: list[str], until: float) -> None:
    with pytest.raises(hr.HenonRefError, match="does not repeat itself three times"):
        hr.periodic_orbit(hr.System(["x", "v"], {}, {"s": "x"}, field), {"x": 1, "v": 0}, until=until)


def test_what_slides_and_rests_leaves_no_coordinate_free() -> None:
    """A block that a belt carries past a mark and back to the start; a ball at rest on a table that moves."""
    carried = hr.System(
        ["x", "v"],
        {},
        {"s": "v - 0.2", "mark": "x - 0.5", "end": "1 - x"},
        ["v", "-x - 5*s"],
        resets={"end": {"map": {"x": 0}}},
    )
    for until in (30.6, 32.6):  # after the reset, and after the mark
        assert hr.periodic_orbit(carried, {"x": 0.1, "v": 0.2}, until=until).period.contains(5)
    map_ = {"v": "-0.5*v + 1.5*w*A*cos(w*t)"}
    values = {"w": "2*pi", "A": 0.05}
    table = hr.System(["x", "v"], values, {"s": "x - A*sin(w*t)"}, ["v", "-10"], resets={"s": {"map": map_}})
    rest = hr.periodic_orbit(table, {"x": 0.1, "v": 0}, until=20, period=1)
    assert (rest.dimension, rest.multipliers, rest.events) == (0, (), ())
    with pytest.raises(hr.HenonRefError, match="accumulate at"):  # it flies off and comes back to rest each time
        hr.periodic_orbit(table, {"x": 0.5, "v": 0}, until=20, period=1, parameters={"A": 0.3})


def test_only_the_last_transitions_are_examined(monkeypatch: pytest.MonkeyPatch) -> None:
    """At least three of them are required."""
    belt = hr.System(["x", "v"], {"F": 1, "d": 3, "vb": 0.2}, {"s": "v - vb"}, ["v", "-x - F*s/(1 + d*s*(v - vb))"])
    monkeypatch.setattr("henon_ref.analysis.periodic_orbit.LAST_TRANSITIONS", 2)
    with pytest.raises(hr.HenonRefError, match="does not repeat itself"):
        hr.periodic_orbit(belt, {"x": 1.5, "v": 0}, until=100)
