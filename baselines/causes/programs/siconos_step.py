"""What Siconos' time stepping makes of events, by itself; run by the Python that has it. A line: a name and numbers."""

from __future__ import annotations

from typing import Any

import numpy
import siconos.kernel as kernel
import siconos.numerics as numerics


def sides(start: list[float], field: list[list[float]], push: list[float], step: float, until: float) -> list[float]:
    """Times at which the sign of the last state, which a relay of strength ``push`` acts on, has changed."""
    system = kernel.FirstOrderLinearDS(start, numpy.array(field))
    relation = kernel.FirstOrderLinearTIR(numpy.array([[0.0] * (len(start) - 1) + [1.0]]), numpy.array([push]).T)
    interaction = kernel.Interaction(kernel.RelayNSL(1, -1.0, 1.0), relation)
    model = kernel.NonSmoothDynamicalSystem(0.0, until)
    model.insertDynamicalSystem(system)
    model.link(interaction, system)
    relay = kernel.Relay(numerics.SICONOS_RELAY_LEMKE)
    clock = kernel.TimeDiscretisation(0.0, step)
    stepping = kernel.TimeStepping(model, clock, kernel.EulerMoreauOSI(1.0), relay)
    found, before = [], 0.0
    while stepping.hasNextEvent():
        stepping.computeOneStep()
        now = float(interaction.lambda_(0)[0])
        if before * now < 0:
            found.append(float(stepping.nextTime()))
        before = now
        stepping.nextStep()
    return found


def square(step: float, until: float) -> list[float]:
    """States of x' = x^2 from 1 after each step, with a relay that does nothing."""

    class Square(kernel.FirstOrderNonLinearDS):
        def computef(self, time: float, x: numpy.ndarray) -> None:
            self.f()[:] = [x[0] ** 2]

        def computeJacobianfx(self, time: float, x: numpy.ndarray) -> None:  # noqa: N802
            self.jacobianfx()[:] = [[2.0 * x[0]]]

    class Idle(kernel.FirstOrderNonLinearR):
        def computeh(self, time: Any, x: Any, lam: Any, z: Any, y: Any) -> None:
            y[0] = x[0]

        def computeg(self, time: Any, x: Any, lam: Any, z: Any, r: Any) -> None:
            r[:] = [0.0]

        def computeJachx(self, time: Any, x: Any, lam: Any, z: Any, c: Any) -> None:  # noqa: N802
            c[:] = [[1.0]]

        def computeJacglambda(self, time: Any, x: Any, lam: Any, z: Any, b: Any) -> None:  # noqa: N802
            b[:] = [[0.0]]

        def computeJacgx(self, time: Any, x: Any, lam: Any, z: Any, k: Any) -> None:  # noqa: N802
            k[:] = [[0.0]]

        def computeJachlambda(self, time: Any, x: Any, lam: Any, z: Any, d: Any) -> None:  # noqa: N802
            d[:] = [[0.0]]

    system, relation = Square([1.0]), Idle()
    system.setFPtr([1.0])
    system.setJacobianfxPtr(numpy.zeros((1, 1)))
    interaction = kernel.Interaction(kernel.RelayNSL(1, -1.0, 1.0), relation)
    model = kernel.NonSmoothDynamicalSystem(0.0, until)
    model.insertDynamicalSystem(system)
    model.link(interaction, system)
    clock, relay = kernel.TimeDiscretisation(0.0, step), kernel.Relay(numerics.SICONOS_RELAY_LEMKE)
    stepping = kernel.TimeStepping(model, clock, kernel.EulerMoreauOSI(1.0), relay)
    stepping.setComputeResiduY(True)
    stepping.setComputeResiduR(True)
    stepping.setNewtonMaxIteration(30)
    found = []
    while stepping.hasNextEvent():
        stepping.advanceToEvent()
        found.append(float(system.x()[0]))
        stepping.nextStep()
    return found


for step in (1e-2, 1e-3):
    (time, *_) = sides([1.1, 0.0], [[0.0, 1.0], [-1.0, 0.0]], [0.0, 0.25], step, 4.0)
    print("turn", step, repr(time))
states = square(1e-3, 2.0)
print("pole", len(states), repr(states[-1]), next(k for k, x in enumerate(states, 1) if x < 0))
