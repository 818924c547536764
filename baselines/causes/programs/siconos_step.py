"""Minimal runs of Siconos' time stepping with a relay. Each line of the output is a name followed by numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy
import siconos.kernel as kernel
import siconos.numerics as numerics

Function = Callable[[float], float]


def steps_of(
    start: list[float], field: list[list[float]], push: list[float], step: float, until: float
) -> Iterator[tuple[float, float, float]]:
    """Yield (time, last state, relay) after each step of x' = field x + push relay; the last state sets the relay."""
    system = kernel.FirstOrderLinearDS(start, numpy.array(field))
    relation = kernel.FirstOrderLinearTIR(numpy.array([[0.0] * (len(start) - 1) + [1.0]]), numpy.array([push]).T)
    interaction = kernel.Interaction(kernel.RelayNSL(1, -1.0, 1.0), relation)
    model = kernel.NonSmoothDynamicalSystem(0.0, until)
    model.insertDynamicalSystem(system)
    model.link(interaction, system)
    relay = kernel.Relay(numerics.SICONOS_RELAY_LEMKE)
    clock = kernel.TimeDiscretisation(0.0, step)
    stepping = kernel.TimeStepping(model, clock, kernel.EulerMoreauOSI(1.0), relay)
    while stepping.hasNextEvent():
        stepping.computeOneStep()
        yield float(stepping.nextTime()), float(system.x()[-1]), float(interaction.lambda_(0)[0])
        stepping.nextStep()


def turns(steps: Iterator[tuple[float, float, float]]) -> list[float]:
    """Times at which the relay changes its sign."""
    found, before = [], 0.0
    for time, _, now in steps:
        if before * now < 0:
            found.append(time)
        before = now
    return found


def followed(
    field: Function, slope: Function, surface: Function, gradient: Function, until: float
) -> list[list[float]]:
    """[x, sign of the surface] of x' = field(x), x(0) = 1, after each step of 0.001; the relay does not act on x."""

    class Field(kernel.FirstOrderNonLinearDS):
        def computef(self, time: float, x: numpy.ndarray) -> None:
            self.f()[:] = [field(x[0])]

        def computeJacobianfx(self, time: float, x: numpy.ndarray) -> None:  # noqa: N802
            self.jacobianfx()[:] = [[slope(x[0])]]

    class Idle(kernel.FirstOrderNonLinearR):
        def computeh(self, time: Any, x: Any, lam: Any, z: Any, y: Any) -> None:
            y[0] = surface(x[0])

        def computeg(self, time: Any, x: Any, lam: Any, z: Any, r: Any) -> None:
            r[:] = [0.0]

        def computeJachx(self, time: Any, x: Any, lam: Any, z: Any, c: Any) -> None:  # noqa: N802
            c[:] = [[gradient(x[0])]]

        def computeJacglambda(self, time: Any, x: Any, lam: Any, z: Any, b: Any) -> None:  # noqa: N802
            b[:] = [[0.0]]

        def computeJacgx(self, time: Any, x: Any, lam: Any, z: Any, k: Any) -> None:  # noqa: N802
            k[:] = [[0.0]]

        def computeJachlambda(self, time: Any, x: Any, lam: Any, z: Any, d: Any) -> None:  # noqa: N802
            d[:] = [[0.0]]

    system, relation = Field([1.0]), Idle()
    system.setFPtr([field(1.0)])
    system.setJacobianfxPtr(numpy.zeros((1, 1)))
    interaction = kernel.Interaction(kernel.RelayNSL(1, -1.0, 1.0), relation)
    model = kernel.NonSmoothDynamicalSystem(0.0, until)
    model.insertDynamicalSystem(system)
    model.link(interaction, system)
    clock, relay = kernel.TimeDiscretisation(0.0, 1e-3), kernel.Relay(numerics.SICONOS_RELAY_LEMKE)
    stepping = kernel.TimeStepping(model, clock, kernel.EulerMoreauOSI(1.0), relay)
    stepping.setComputeResiduY(True)
    stepping.setComputeResiduR(True)
    stepping.setNewtonTolerance(1e-12)
    stepping.setNewtonMaxIteration(30)
    found = []
    while stepping.hasNextEvent():
        stepping.advanceToEvent()
        found.append([float(system.x()[0]), -float(interaction.lambda_(0)[0])])
        stepping.nextStep()
    return found


def steep(x: float) -> float:
    """Exponential part of a surface function that falls from 0 to -5e21 in one second; also its slope divided by 50."""
    return -math.exp(50.0 * (x - 1.0))


for step in (1e-2, 1e-3):
    (time, *_) = turns(steps_of([1.1, 0.0], [[0.0, 1.0], [-1.0, 0.0]], [0.0, 0.25], step, 4.0))
    print("turn", step, repr(time))
states = [x for x, _ in followed(lambda x: x**2, lambda x: 2.0 * x, lambda x: x, lambda x: 1.0, 2.0)]
print("pole", len(states), repr(states[-1]), next(k for k, x in enumerate(states, 1) if x < 0))
signs = followed(lambda x: 1.0, lambda x: 0.0, lambda x: 1.0 + steep(x), lambda x: 50.0 * steep(x), 1.0)
wrong = [x for x, sign in signs if x > 1.01 and sign > -0.5]
print("steep", len(wrong), repr(min(wrong, default=math.nan)))
for size in (1e2, 1e18):
    # x' = -size above the surface x = 0 and 1 below it, from x = 0: the first state is the mean of the two.
    slide = steps_of([(1.0 - size) / 2, 0.0], [[0.0, 0.0], [1.0, 0.0]], [0.0, (1.0 + size) / 2], 1e-3, 1e-1)
    print("slide", size, repr(max(abs(x) for _, x, _ in slide)))
swing = steps_of([0.0, 1.0], [[0.0, -1e4], [1.0, 0.0]], [0.0, 0.0], 1e-3, 4e-2)  # x'' = -1e4 x from 1
print("swing", repr(min(x for _, x, _ in swing)))
