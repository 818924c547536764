"""diffrax's best batch on a sweep of the Stribeck belt: vmap over belt speeds, friction smoothed, no events.

    pip install 'henon-ref[peers]' && python docs/smoothed_batch.py

Prints, for widths of the smoothing, the runs a second of processor time (all threads together) and the largest and
median error of the final state against ``henon``.
"""

from __future__ import annotations

from time import process_time
from typing import Any

import numpy as np

import henon_ref as hr

COUNT, UNTIL, RTOL = 256, 20.0, 1e-6
SPEEDS = np.linspace(0.15, 0.9, COUNT)


def reference() -> tuple[np.ndarray, float]:
    """Final states by ``henon``, shape (COUNT, 2), and runs a second of processor time, compiling apart."""
    belt = hr.System(
        state=["x", "v"],
        parameters={"F": 1, "d": 3, "vb": 0.5},
        surfaces={"s": "v - vb"},
        field=["v", "-x - F*s/(1 + d*s*(v - vb))"],
    )
    how = {"until": UNTIL, "observe": [hr.observe.final_state()], "rtol": 1e-9, "jobs": 1}
    hr.sweep(belt, {"x": 1.5, "v": 0}, grid={"vb": SPEEDS[:2]}, **how)
    began = process_time()
    table = hr.sweep(belt, {"x": 1.5, "v": 0}, grid={"vb": SPEEDS}, **how)
    return table[["final_x", "final_v"]].to_numpy(), COUNT / (process_time() - began)


def smoothed(width: float) -> tuple[np.ndarray, float]:
    """The same by diffrax: sgn(w) is tanh(w / width), Kvaerno5 (the smoothed stick is stiff), all runs in one vmap."""
    import diffrax
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)

    def field(t: Any, y: Any, speed: Any) -> Any:
        slip = y[1] - speed
        return jnp.stack([y[1], -y[0] - jnp.tanh(slip / width) / (1 + 3 * jnp.abs(slip))])

    def final(speed: Any) -> Any:
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field), diffrax.Kvaerno5(), 0.0, UNTIL, None, jnp.array([1.5, 0.0]), args=speed,
            stepsize_controller=diffrax.PIDController(rtol=RTOL, atol=RTOL), max_steps=100_000,
            adjoint=diffrax.ForwardMode(),
        )  # fmt: skip
        return solution.ys[-1]

    batch = jax.jit(jax.vmap(final))
    np.asarray(batch(SPEEDS))  # compiles
    began = process_time()
    states = np.asarray(batch(SPEEDS))
    return states, COUNT / (process_time() - began)


if __name__ == "__main__":
    exact, rate = reference()
    print(f"henon: {rate:,.0f} runs/s")
    for width in (1e-2, 1e-3, 1e-4):
        states, rate = smoothed(width)
        off = np.abs(states - exact).max(axis=1)
        print(
            f"diffrax, width {width:g}: {rate:,.0f} runs/s, off by {off.max():.1e} at most, {np.median(off):.1e} median"
        )
