"""Section 5: Lyapunov exponents of the rig of Fig. 9, by the equations and by samples. Section 6: the moving belt.

Exponents from samples follow Eqs. (25) and (26) (Sano and Sawada 1985). Around every d-th sample the method follows the
neighbours in a ball for d samples. The least-squares linear map from their initial to their final distances,
``A_j = (sum y_{k+d} y_k^T)(sum y_k y_k^T)^-1`` (Eq. 25), approximates the derivative of the flow. The exponents are the
mean logarithmic rates at which the product of the A_j stretches an orthonormal basis (Eq. 26, with QR instead of Gram
and Schmidt).

The samples lie on the attractor and therefore contain the stretching of directions *along* it only. If the dimension
of the attractor is below that of the state space (a curve, a torus), the second sum has no inverse: its small
eigenvalues measure the curvature of the attractor, not another direction. Eigenvectors below a cutoff are left out.
The exponents of the missing directions are then rounding noise; :attr:`Measured.directions` is the number of directions
in the samples.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy as sp
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from henon_ref.analysis.lyapunov import Spectrum, lyapunov_spectrum
from henon_ref.analysis.periodic_orbit import measured_period
from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.errors import ModelError
from henon_ref.figures import style
from henon_ref.harness.registry import solver
from henon_ref.harness.studies.page import largest_time_difference, shipped_problem
from henon_ref.harness.studies.paper.equations import rig_equations
from henon_ref.harness.studies.paper.systems import Findings
from henon_ref.harness.table import Table
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import sticks

SETS = {
    "periodic": ("rig_periodic",),
    "quasi-periodic": ("rig_quasiperiodic", "fast"),
    "chaotic": ("rig_chaotic",),
}
"""The paper's three kinds of motion, and our cases of them, which differ in the speed of the belt."""
SINCE, SPAN, SAMPLES = 3000, 9000, 45001
"""The paper's samples: from t = 3000 to t = 12000, 0.2 apart."""
INTERVAL = SPAN / (SAMPLES - 1)
AVERAGING_TIME = 10_000.0
"""Time over which the variational exponents are averaged."""
RADIUS, DELAY = 0.05, 5
"""Settings of the estimate, see :func:`estimated`."""
LEAST, APART = 12, 25
"""Smallest number of neighbours (a ball with fewer is widened), and distance in samples up to which two samples are not
neighbours, since they are on the same piece of orbit (Theiler 1986)."""
ZERO_EXPONENT = 5e-4
"""An exponent whose average over ``AVERAGING_TIME`` is below this counts as zero."""
LOWEST = -60.0
"""Bottom of the figure's axis of exponents [1/s]."""


@dataclass(frozen=True)
class Measured:
    """Exponents of one set of parameters, by the equations and by samples."""

    speed: str
    """Speed of the belt, on which the block starts."""
    spectrum: Spectrum
    samples: NDArray[np.float64]
    """States, shape (45001, 4)."""
    estimates: Sequence[float]
    """Exponents by the samples [1/s], largest first up to statistical noise."""
    directions: float
    """Mean number of directions that neighbours span; the samples determine only this number of exponents."""

    @property
    def zeros(self) -> int:
        """Number of exponents that count as zero."""
        return sum(abs(e) < ZERO_EXPONENT for e in self.spectrum.exponents)


def measured(kind: str) -> Measured:
    """Compute the exponents of one kind of motion, by the equations and by the paper's number of samples."""
    problem = shipped_problem(*SETS[kind])
    spectrum = lyapunov_spectrum(problem, discard=1000.0, span=AVERAGING_TIME)
    times = np.linspace(SINCE, SINCE + SPAN, SAMPLES)
    longer = replace(problem, until=sp.Integer(SINCE + SPAN))
    run = HENON_SOLVER.prepare(longer, rtol=1e-12, sample_times=times)()
    assert run.samples is not None
    return Measured(f"{float(problem.initial[1]):.2f}", spectrum, run.samples, *estimated(run.samples))


def section() -> Findings:
    """Check the claims of Sections 5 and 6, and draw their figures."""
    sets = {kind: measured(kind) for kind in SETS}
    periodic, quasi_periodic, chaotic = sets.values()
    largest, estimate = chaotic.spectrum.exponents[0], max(chaotic.estimates)
    deviation = chaotic.spectrum.standard_errors[0]
    periods, belt, equations = _periods(), moving_belt(), rig_equations()
    signs = (
        abs(max(periodic.estimates)) < 10 * ZERO_EXPONENT
        and sorted(map(abs, quasi_periodic.estimates))[1] < 10 * ZERO_EXPONENT
        and estimate > 10 * ZERO_EXPONENT
    )
    return Findings(
        {
            **equations.holds,
            **belt.holds,
            "estimate": signs and abs(estimate / largest - 1) < 0.25,
            "samples": all(own.samples.shape == (SAMPLES, 4) for own in sets.values()),
            "periodic": periodic.zeros == 1
            and all(abs(period - 8.8604442) < 1e-7 for period in periods)  # of the rig at vp = 0.40
            and abs(periods[0] - periods[1]) < 1e-11,
            "quasi_periodic": quasi_periodic.zeros == 2,
            # Five standard errors, since the digits of a chaotic orbit depend on the machine.
            "chaotic": largest > 5.0 * deviation and chaotic.zeros == 1,
            "lost": all(own.spectrum.lost == 1 for own in sets.values()),
        },
        {
            **equations.values,
            **belt.values,
            "exponents": exponent_table(sets).markdown,
            "periods": periods,
            "radius": RADIUS,
            "delay": DELAY,
            "estimate": estimate,
            "largest": largest,
            "deviation": deviation,
            "span": AVERAGING_TIME,
        },
        {"section5_motions": draw_motions(sets), "section5_estimate": draw_estimate(chaotic)},
    )


def _periods() -> list[float]:
    """Period at vp = 0.40 by two solvers; NaN if there is none."""
    found = []
    for name in ("henon", "heyoka"):
        problem = replace(shipped_problem("rig_periodic"), until=sp.Integer(3200))
        run = solver(name).prepare(problem, rtol=1e-14, atol=1e-14)()
        period = measured_period(run.transitions, after=2800)
        found.append(float("nan") if period is None else period.value)
    return found


def exponent_table(sets: dict[str, Measured]) -> Table:
    """Table of the exponents by the equations and by the samples."""
    lines = []
    for kind, found in sets.items():
        own = found.spectrum
        exact = ", ".join(f"{e:.4f}" for e in own.exponents[: 4 - own.lost])
        estimates = ", ".join(f"{e:.3g}" for e in sorted(found.estimates, reverse=True))
        stuck = f"{100 * own.stick_fraction:.0f} %"
        lines.append((kind, found.speed, f"{exact}, -inf", f"{own.lost}", stuck, estimates, f"{found.directions:.2f}"))
    headings = ("motion", "vp", "from the equations", "lost", "in sticks", "from the samples", "directions seen")
    return Table(headings, "l", lines)


def draw_motions(sets: dict[str, Measured]) -> Figure:
    """Draw the phase plane of the block in the three motions."""
    with style.figure(2.9) as figure:
        for ax, (kind, own) in zip(figure.subplots(1, 3), sets.items(), strict=True):
            # More samples would make the file large without a visible difference.
            ax.plot(*own.samples[:3000, :2].T, color=style.BLUE, lw=0.5)
            ax.axhline(float(own.speed), color=style.VERMILLION, lw=0.8, label="belt")
            ax.set_title(f"{kind}, $v_p$ = {own.speed}")
            ax.set(xlabel="$x_1$", ylabel="$x_2$")
        figure.axes[0].legend(loc="center")
        figure.set_layout_engine("constrained")
    return figure


def draw_estimate(chaotic: Measured) -> Figure:
    """Draw the estimate for the chaotic motion over radius, delay and number of samples."""
    every, radii, delays = chaotic.samples, (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4), (1, 2, 5, 10, 20, 50, 100)
    lengths = (1500, 3000, 6000, 12000, 24000, SAMPLES)
    sweeps: dict[str, dict[float, Sequence[float]]] = {
        "radius / size of the set": {r: estimated(every, radius=r)[0] for r in radii},
        "delay [samples of 0.2]": {d: estimated(every, delay=d)[0] for d in delays},
        "number of samples": {n: estimated(every[:n])[0] for n in lengths},
    }
    with style.figure(3.6) as figure:
        axes = figure.subplots(2, 3, sharex="col", sharey="row", height_ratios=(3, 1))
        for column, (label, spectra) in enumerate(sweeps.items()):
            _draw_sweep(axes[0, column], axes[1, column], spectra)
            axes[1, column].set(xlabel=label, xscale="log")
            axes[1, column].xaxis.set_minor_formatter(NullFormatter())
            for e in chaotic.spectrum.exponents[:-1]:
                axes[0, column].axhline(e, color=style.GREY, lw=0.9)
        axes[0, 0].set(ylabel="exponents", ylim=(-0.32, 0.14))
        axes[1, 0].set(ylabel="the one that\nis -infinity", ylim=(LOWEST, 0))
        axes[0, 2].legend(loc="lower right")
        figure.set_layout_engine("constrained")
    return figure


def _draw_sweep(upper: Axes, lower: Axes, spectra: Mapping[float, Sequence[float]]) -> None:
    values, ordered = list(spectra), np.array([sorted(own, reverse=True) for own in spectra.values()])
    colours = (style.VERMILLION, style.BLUE, style.GREEN)
    for i, (colour, marker) in enumerate(zip(colours, "osD", strict=True)):
        upper.plot(values, ordered[:, i], marker=marker, color=colour, label=f"$\\lambda_{i + 1}$")
    lower.plot(values, np.maximum(ordered[:, 3], LOWEST), "v", color=style.BLACK, clip_on=False, zorder=4)


def moving_belt() -> Findings:
    """Run the block on the moving belt with ``henon`` and ``heyoka``, and compare the runs."""
    problem = shipped_problem("moving_belt")
    problem = replace(problem, until=30 * problem.until)  # long enough to settle
    times = np.linspace(0.0, float(problem.until), 40001)[:-1]
    run = HENON_SOLVER.prepare(problem, rtol=1e-13, sample_times=times)()
    other = solver("heyoka").prepare(problem, rtol=1e-13, atol=1e-13)()
    assert run.samples is not None
    assert run.sample_modes is not None
    stuck = np.ravel(run.sample_modes) == 0
    (x2,), (surface,) = problem.system.states[1:], map(problem.system.numeric, problem.system.surfaces)
    belt = sp.lambdify(TIME, x2 - surface)(times)
    last = [stick.duration for stick in sticks(run.transitions, start=0.0, after=0.0)[-2:]]
    apart = largest_time_difference(run, other)
    drift = float(np.abs(run.samples[stuck, 1] - belt[stuck]).max())
    return Findings(
        {"moving_belt": run.status == "ok" and apart < 1e-10 and drift < 1e-12},
        {"belt_transitions": len(run.transitions), "apart": apart, "drift": drift, "settled": sorted(last)},
    )


def estimated(
    samples: NDArray[np.float64], *, radius: float = RADIUS, delay: int = DELAY, cutoff: float = 0.02
) -> tuple[list[float], float]:
    """Estimate the Lyapunov exponents of a flow from samples; no radius and delay are right for all samples.

    ``samples``, shape (k, n), are states at intervals of :data:`INTERVAL`. ``radius`` is that of the ball of
    neighbours, relative to the size of the set (root-mean-square distance from the mean), and ``delay`` the number d of
    samples between a distance and its image, and between two reference points. A direction is left out if the
    neighbours' spread in it is below the part ``cutoff`` of their largest spread.

    Returns the n exponents [1/s] in the order of the basis vectors (largest first, up to statistical noise), and the
    mean number of directions that the neighbours span. ModelError if samples are not finite, or too few.
    """
    samples = np.ascontiguousarray(samples, dtype=float)
    if not np.isfinite(samples).all():
        raise ModelError("samples with gaps: the trajectory ended before the last sample time")
    if len(samples) - delay < 2 * APART + 1 + LEAST:
        raise ModelError(f"{len(samples)} samples are too few")
    spread, moved = _moments(samples, radius, delay)
    values, axes = np.linalg.eigh(spread)
    kept = values > cutoff**2 * values[:, -1:]
    inverse = np.where(kept, 1.0 / np.where(kept, values, 1.0), 0.0)
    maps = moved @ (axes * inverse[:, None, :]) @ axes.transpose(0, 2, 1)
    exponents = _growth(maps) / (delay * INTERVAL)
    return exponents.tolist(), float(kept.sum(axis=1).mean())


def _growth(maps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean logarithm of the growth of each basis vector per map (Eq. 26), shape (n,)."""
    basis = np.eye(maps.shape[-1])
    diagonals = np.empty(maps.shape[:2])
    for j, matrix in enumerate(maps):
        basis, triangle = np.linalg.qr(matrix @ basis)
        diagonals[j] = np.diag(triangle)
    with np.errstate(divide="ignore"):
        return np.log(np.abs(diagonals)).mean(axis=0)


def _moments(
    samples: NDArray[np.float64], radius: float, delay: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute both sums of Eq. (25), sum y_k y_k^T and sum y_{k+d} y_k^T, at every reference point, shape (r, n, n)."""
    radius *= float(np.sqrt(((samples - samples.mean(axis=0)) ** 2).sum(axis=1).mean()))
    last = len(samples) - delay
    references = np.arange(0, last, delay)
    tree = cKDTree(samples[:last])
    sums = []
    # Parts of so many reference points bound the memory of their neighbours.
    for some in np.array_split(references, -(-len(references) // 2048)):
        near = tree.query_ball_point(samples[some], radius)
        neighbours = [_separated_in_time(found, at) for found, at in zip(near, some.tolist(), strict=True)]
        narrow = [j for j, found in enumerate(neighbours) if len(found) < LEAST]
        if narrow:
            _, ranked = tree.query(samples[some[narrow]], k=LEAST + 2 * APART + 1)
            for j, found in zip(narrow, ranked, strict=True):
                neighbours[j] = _separated_in_time(found, some[j])[:LEAST]
        which = np.repeat(np.arange(len(some)), list(map(len, neighbours)))
        index, at = np.concatenate(neighbours), some[which]
        y, z = ((samples[index + k] - samples[at + k]).T for k in (0, delay))
        sums.append([[[np.bincount(which, u * v) for v in y] for u in left] for left in (y, z)])
    spread, moved = np.concatenate(sums, axis=-1).transpose(0, 3, 1, 2)
    return spread, moved


def _separated_in_time(found: list[int] | NDArray[np.intp], at: int) -> NDArray[np.int64]:
    """Return the samples that are not close in time to a reference point."""
    index = np.asarray(found, dtype=np.int64)
    return index[np.abs(index - at) > APART]
