"""What Siconos' time stepping makes of events, by itself; run by the Python that has it. A line: a name and numbers."""

from __future__ import annotations

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


for step in (1e-2, 1e-3):
    (time, *_) = sides([1.1, 0.0], [[0.0, 1.0], [-1.0, 0.0]], [0.0, 0.25], step, 4.0)
    print("turn", step, repr(time))
