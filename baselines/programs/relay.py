"""Siconos as a program of the protocol: the sign is a relay, and Moreau's time stepping uses a fixed step.

The Python interpreter that has Siconos runs this file; it requires Siconos and NumPy only. The program reads the
request from standard input and writes the response to standard output (docs/protocol.md).

With the fields f+ and f- on the two sides, Filippov's system is x' = (f+ + f-)/2 + s (f+ - f-)/2, s in sgn(h(x)).
Siconos' relay has the opposite sign, lambda = -s. The time is a further state, so that the system is autonomous. Lambda
at the end of each step gives the mode: -1 or +1 at an end of the relay, a slide (0) between the ends. In time stepping
a crossing appears as a slide of a single step between two sides, and is reported as a crossing.
"""

from __future__ import annotations

import json
import math
import os
import re
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

NEWTON = 1e-12
"""Residual at which Newton's iteration of a step ends, in units of the state."""


def made(texts: list[str], names: dict[str, str]) -> Callable[..., Any]:
    """Make one function of (x, p) from texts of the request; it returns a tuple. The last entry of x is the time."""
    pattern = re.compile(r"(?<![\w.])[A-Za-z]\w*")
    body = ", ".join(pattern.sub(lambda word: names.get(word[0], word[0]), text) for text in texts)
    functions = {name: own for name, own in vars(math).items() if callable(own)}
    found: Callable[..., Any] = eval(f"lambda x, p: ({body},)", functions)
    return found


class Equations:
    """Half sum and half difference of the two fields of a problem, with the time as a further state."""

    def __init__(self, problem: Any) -> None:
        names = {name: f"x[{k}]" for k, name in enumerate(problem["states"])}
        names |= {name: f"p[{k}]" for k, name in enumerate(problem["parameters"])}
        names["t"] = f"x[{len(problem['states'])}]"
        self.p = list(problem["parameters"].values())
        self.size = len(problem["states"]) + 1
        modes = {mode["mode"]: mode for mode in problem["modes"]}
        self.below, self.above = (made(modes[side]["field"], names) for side in (-1, 1))
        self.one_field = modes[-1]["field"] == modes[1]["field"]
        self.surface = made([problem["surface"]["expression"]], names)
        self.gradient = made(problem["surface"]["gradient"], names)
        guards = [guard for mode in modes.values() for guard in mode["guards"]]
        self.valid = made([guard["expression"] for guard in guards if guard["kind"] == "valid"] or ["1.0"], names)
        self.own_slide = any(not guard["armed"] for guard in guards)

    def on_surface(self, x: list[float]) -> list[float]:
        """Return the point nearest to x on the surface, to first order, at the same time."""
        h, slopes = self.surface(x, self.p)[0], self.gradient(x, self.p)
        square = sum(slope * slope for slope in slopes)
        if not square:
            return list(x)
        return [*(value - h * slope / square for value, slope in zip(x, slopes, strict=False)), x[-1]]

    def sides(self, x: list[float]) -> Iterator[tuple[float, float]]:
        """Return the fields below and above. The field of the other side is evaluated on the surface.

        The other side's field may have no value at x. If the surface does not change the field, both are taken at x.
        """
        beyond = x if self.one_field else self.on_surface(x)
        below, above = (beyond, x) if self.surface(x, self.p)[0] > 0.0 else (x, beyond)
        return zip(self.below(below, self.p), self.above(above, self.p), strict=True)

    def mean(self, x: list[float]) -> list[float]:
        """Return (f+ + f-)/2, and 1 for the time."""
        return [(a + b) / 2 for b, a in self.sides(x)] + [1.0]

    def half(self, x: list[float]) -> list[float]:
        """Return (f+ - f-)/2, and 0 for the time."""
        return [(a - b) / 2 for b, a in self.sides(x)] + [0.0]

    def contradicts(self, x: list[float], mode: int, step: float) -> bool:
        """Check whether the surface function contradicts a mode by more than two steps and Newton's residual."""
        field, slopes = (self.above if mode > 0 else self.below)(x, self.p), self.gradient(x, self.p)
        rate = sum(slope * f for slope, f in zip(slopes, field, strict=True))
        residual = NEWTON * sum(abs(slope) * (1.0 + abs(value)) for slope, value in zip(slopes, x, strict=False))
        return self.surface(x, self.p)[0] * mode < -2.0 * step * abs(rate) - residual

    def is_rounded(self, x: list[float], step: float) -> bool:
        """Check whether the rounding of a step can explain the value of the surface function.

        It is assumed to be four roundings of the step's product with the normal velocity.
        """
        push = sum(abs(slope * half) for slope, half in zip(self.gradient(x, self.p), self.half(x), strict=False))
        return abs(self.surface(x, self.p)[0]) <= 4.0 * sys.float_info.epsilon * step * push

    def slopes(self, function: Callable[[list[float]], list[float]], x: list[float]) -> list[tuple[float, ...]]:
        """Return the Jacobian of a function by central differences (accurate enough for Newton's iteration)."""
        columns = []
        for k in range(self.size):
            reach = 1e-6 * (1.0 + abs(x[k]))
            low, high = ([*x[:k], x[k] + way * reach, *x[k + 1 :]] for way in (-1, 1))
            pairs = zip(function(low), function(high), strict=True)
            columns.append([(after - before) / (2 * reach) for before, after in pairs])
        return list(zip(*columns, strict=True))


def simulation(
    kernel: Any, numerics: Any, numpy: Any, own: Equations, problem: Any, step: float
) -> tuple[Any, Any, Any]:
    """Make the dynamical system, the interaction and the time stepping of Siconos."""
    n = own.size

    class Field(kernel.FirstOrderNonLinearDS):
        def computef(self, time: Any, x: Any) -> None:
            self.f()[:] = own.mean(list(x))

        def computeJacobianfx(self, time: Any, x: Any) -> None:  # noqa: N802
            jacobian = self.jacobianfx()
            jacobian[:] = 0.0
            for i, row in enumerate(own.slopes(own.mean, list(x))):
                for k, slope in enumerate(row):
                    jacobian[i, k] = slope

    class Sign(kernel.FirstOrderNonLinearR):
        def computeh(self, time: Any, x: Any, lam: Any, z: Any, y: Any) -> None:
            y[0] = own.surface(x, own.p)[0]

        def computeg(self, time: Any, x: Any, lam: Any, z: Any, r: Any) -> None:
            r[:] = [-half * lam[0] for half in own.half(list(x))]

        def computeJachx(self, time: Any, x: Any, lam: Any, z: Any, c: Any) -> None:  # noqa: N802
            c[:] = 0.0
            for k, slope in enumerate(own.gradient(x, own.p)):
                c[0, k] = slope

        def computeJacglambda(self, time: Any, x: Any, lam: Any, z: Any, b: Any) -> None:  # noqa: N802
            for i, half in enumerate(own.half(list(x))):
                b[i, 0] = -half

        def computeJacgx(self, time: Any, x: Any, lam: Any, z: Any, k: Any) -> None:  # noqa: N802
            k[:] = 0.0
            for i, row in enumerate(own.slopes(own.half, list(x))):
                for j, slope in enumerate(row):
                    k[i, j] = -slope * lam[0]

        def computeJachlambda(self, time: Any, x: Any, lam: Any, z: Any, d: Any) -> None:  # noqa: N802
            d[:] = 0.0

    start = [*problem["start"]["state"], problem["start"]["time"]]
    system = Field(start)
    system.setFPtr(own.mean(start))
    system.setJacobianfxPtr(numpy.zeros((n, n)))
    relation = Sign()
    interaction = kernel.Interaction(kernel.RelayNSL(1, -1.0, 1.0), relation)
    model = kernel.NonSmoothDynamicalSystem(problem["start"]["time"], problem["until"])
    model.insertDynamicalSystem(system)
    model.link(interaction, system)
    clock = kernel.TimeDiscretisation(problem["start"]["time"], step)
    relay = kernel.Relay(numerics.SICONOS_RELAY_LEMKE)
    stepping = kernel.TimeStepping(model, clock, kernel.EulerMoreauOSI(1.0), relay)
    stepping.setComputeResiduY(True)
    stepping.setComputeResiduR(True)
    stepping.setNewtonTolerance(NEWTON)
    stepping.setNewtonMaxIteration(30)
    return system, interaction, stepping


def mode_of(sign: float) -> int:
    """Mode for a value of the relay, which is at its end if it is closer to it than 1e-9."""
    return 0 if abs(sign) < 1.0 - 1e-9 else (1 if sign > 0 else -1)


def steps_of(siconos: tuple[Any, Any, Any], own: Equations, request: Any) -> Iterator[tuple[float, list[float], int]]:
    """Yield (time, state, mode) after each step."""
    problem, step = request["problem"], request["step"]
    system, interaction, stepping = simulation(*siconos, own, problem, step)
    keep = (system, interaction, stepping)  # SWIG's objects do not hold references to each other
    done, start = 0, problem["start"]["time"]
    while stepping.hasNextEvent() and start + (done + 0.5) * step < problem["until"]:
        stepping.advanceToEvent()
        done += 1
        state = [float(value) for value in system.x()[: own.size - 1]]
        yield min(start + done * step, problem["until"]), state, mode_of(-float(interaction.lambda_(0)[0]))
        stepping.nextStep()
    del keep


def run(siconos: tuple[Any, Any, Any], own: Equations, request: Any) -> tuple[str, str, list[Any], Any, int]:
    """Return status, reason, transitions, end, and the number of steps."""
    start = request["problem"]["start"]
    before, done = start["mode"], 0
    events: list[Any] = []
    end = {"time": start["time"], "state": start["state"], "mode": before}
    stop_at = time.process_time() + request["seconds"]
    try:
        for at, state, mode in steps_of(siconos, own, request):
            done += 1
            if not all(math.isfinite(value) for value in state):
                return "failed", "the state is not finite", events, end, done
            if sum(map(abs, state)) > 1e100:
                return "diverged", "a state passed 1e100", events, end, done
            if min(own.valid([*state, at], own.p)) <= 0.0:
                return "invalid", "the model ends: its valid expression fell to 0", events, end, done
            if mode and own.contradicts([*state, at], mode, request["step"]):
                # The modes follow from the relay's sign, and are wrong from here on.
                rounded = own.is_rounded([*state, at], request["step"])
                why = ", which the rounding of a step moves as far," if rounded else ""
                lost = f"the relay's sign is not that of the surface function{why} at t = {at:.17g}"
                return "failed", lost, events, end, done
            if mode != before:
                event = {"time": at, "before": before, "after": mode, "state": state}
                if events and before == 0 and at - events[-1]["time"] < 1.5 * request["step"]:
                    first = events.pop()
                    event |= {"time": first["time"], "state": first["state"], "before": first["before"]}
                if event["before"] != event["after"]:
                    events.append(event)
                before = mode
            if len(events) > request["most_transitions"]:
                return "failed", "more transitions than the request allows", events, end, done
            end = {"time": at, "state": state, "mode": before}
            if time.process_time() > stop_at:
                return "timeout", "the time that a run may take has passed", events, end, done
    except (ArithmeticError, ValueError, RuntimeError) as error:
        return "failed", f"{type(error).__name__}: {' '.join(str(error).split())}"[:300], events, end, done
    end["time"] = request["problem"]["until"]
    return "ok", "", events, end, done


def respond(stream: Any, version: str, status: str, reason: str = "", **found: Any) -> None:
    """Write the response."""
    message = {"protocol": 1, "program": {"name": "relay.py", "version": version}, "status": status, "reason": reason}
    stream.write(json.dumps(message | found) + "\n")
    stream.flush()


def main() -> None:
    """Read the request, make its runs and write the response; Siconos' own output goes to standard error."""
    stream = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    request = json.load(sys.stdin)
    try:
        import numpy
        import siconos.kernel as kernel
        import siconos.numerics as numerics
    except ImportError as error:
        return respond(stream, "", "unavailable", f"Siconos cannot be imported: {error}")
    version = sys.argv[1] if len(sys.argv) > 1 else ""
    own = Equations(request["problem"])
    if request["step"] is None:
        return respond(stream, version, "unsupported", "time stepping is driven by a step")
    if own.own_slide:
        return respond(stream, version, "unsupported", "a relay supports Filippov's sliding only")
    times: list[float] = []
    for number in range(1 - request["untimed"], request["timed"] + 1):
        began = time.monotonic()
        status, reason, events, end, done = run((kernel, numerics, numpy), own, request)
        if number > 0:
            times.append(time.monotonic() - began)
    return respond(stream, version, status, reason, transitions=events, end=end, wall_s=times, work={"steps": done})


if __name__ == "__main__":
    main()
