"""Section 5: the rig of Fig. 9 and its Lyapunov exponents, by the equations and by samples. Section 6: moving belt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy as sp
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from henon_ref.analysis.lyapunov import Spectrum, lyapunov_spectrum
from henon_ref.analysis.periodic_orbit import measured_period
from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.figures import style
from henon_ref.harness.registry import solver
from henon_ref.harness.studies.page import largest_time_difference, shipped_problem
from henon_ref.harness.studies.paper.systems import Findings, same_all
from henon_ref.harness.studies.paper.timeseries import Settings, TimeSeriesSpectrum, time_series_spectrum
from henon_ref.harness.table import Table
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME

SETS = {
    "periodic": ("rig_periodic",),
    "quasi-periodic": ("rig_quasiperiodic", "fast"),
    "chaotic": ("rig_chaotic",),
}
"""The paper's three kinds of motion, and our cases of them, which differ in the speed of the belt."""
SINCE, SPAN, SAMPLES = 3000, 9000, 45001
"""The paper's samples: from t = 3000 to t = 12000, 0.2 apart."""
INTERVAL = SPAN / (SAMPLES - 1)
LONG = 10_000.0
"""Time over which the variational exponents are averaged."""
SETTINGS = Settings(radius=0.05, delay=5)
ZERO = 5e-4
"""An exponent whose average over ``LONG`` is below this counts as zero."""
SIGNIFICANT = 5.0
"""Number of standard errors by which a positive exponent must exceed zero. (The digits of a chaotic orbit depend on the
machine.)"""
LOWEST = -60.0
"""Bottom of the figure's axis of exponents [1/s]."""
PERIOD = 8.8604442
"""Period of the rig at vp = 0.40."""
SETTLED = 30
"""Horizon of the moving belt's run, as a multiple of the case's horizon."""


@dataclass(frozen=True)
class Measured:
    """Exponents of one set of parameters, by the equations and by samples."""

    speed: str
    """Speed of the belt, on which the block starts."""
    spectrum: Spectrum
    samples: NDArray[np.float64]
    """States, shape (45001, 4)."""
    series: TimeSeriesSpectrum

    @property
    def zeros(self) -> int:
        """Number of exponents that count as zero."""
        return sum(abs(e) < ZERO for e in self.spectrum.exponents)


def measured(kind: str) -> Measured:
    """Compute the exponents of one kind of motion, by the equations and by the paper's number of samples."""
    problem = shipped_problem(*SETS[kind])
    spectrum = lyapunov_spectrum(problem, discard=1000.0, span=LONG)
    times = np.linspace(SINCE, SINCE + SPAN, SAMPLES)
    longer = replace(problem, until=sp.Integer(SINCE + SPAN))
    run = HENON_SOLVER.prepare(longer, rtol=1e-12, sample_times=times)()
    assert run.samples is not None
    series = time_series_spectrum(run.samples, INTERVAL, SETTINGS)
    return Measured(f"{float(problem.initial[1]):.2f}", spectrum, run.samples, series)


def section() -> Findings:
    """Check the claims of Sections 5 and 6, and draw their figures."""
    sets = {kind: measured(kind) for kind in SETS}
    periodic, quasi_periodic, chaotic = sets.values()
    largest, estimate = chaotic.spectrum.exponents[0], max(chaotic.series.exponents)
    deviation = chaotic.spectrum.standard_errors[0]
    periods, belt, equations = _periods(), moving_belt(), _equations()
    signs = (
        abs(max(periodic.series.exponents)) < 10 * ZERO
        and sorted(map(abs, quasi_periodic.series.exponents))[1] < 10 * ZERO
        and estimate > 10 * ZERO
    )
    return Findings(
        {
            **equations.holds,
            **belt.holds,
            "estimate": signs and abs(estimate / largest - 1) < 0.25,
            "samples": all(own.samples.shape == (SAMPLES, 4) for own in sets.values()),
            "periodic": periodic.zeros == 1
            and all(abs(period - PERIOD) < 1e-7 for period in periods)
            and abs(periods[0] - periods[1]) < 1e-11,
            "quasi_periodic": quasi_periodic.zeros == 2,
            "chaotic": largest > SIGNIFICANT * deviation and chaotic.zeros == 1,
            "lost": all(own.spectrum.lost == 1 for own in sets.values()),
        },
        {
            **equations.values,
            **belt.values,
            "exponents": exponent_table(sets).markdown,
            "periods": periods,
            "radius": SETTINGS.radius,
            "delay": SETTINGS.delay,
            "estimate": estimate,
            "largest": largest,
            "deviation": deviation,
            "span": LONG,
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


def _equations() -> Findings:
    """Check Eqs. (27) and (28), and the motion of the rig with the signs as printed from a block at rest."""
    at_rest = shipped_problem("rig_printed", "at_rest")
    printed, corrected = at_rest.system, shipped_problem("rig_periodic").system
    both = all(
        same_all([*map(system.numeric, system.field)], eq27(system, printed=flag))
        for system, flag in ((printed, True), (corrected, False))
    )
    flutter, damped = (float(frictionless_eigenvalues(system)[0].real) for system in (printed, corrected))
    run = HENON_SOLVER.prepare(at_rest, rtol=1e-13)()
    return Findings(
        {"eq_27": both and flutter > 0 > damped and run.status == "invalid", "terms": both},
        {"flutter": flutter, "damped": damped, "lost": run.end_time},
    )


def exponent_table(sets: dict[str, Measured]) -> Table:
    """Table of the exponents by the equations and by the samples."""
    lines = []
    for kind, found in sets.items():
        own, series = found.spectrum, found.series
        exact = ", ".join(f"{e:.4f}" for e in own.exponents[: 4 - own.lost])
        estimated = ", ".join(f"{e:.3g}" for e in sorted(series.exponents, reverse=True))
        stuck = f"{100 * own.stick_fraction:.0f} %"
        lines.append((kind, found.speed, f"{exact}, -inf", f"{own.lost}", stuck, estimated, f"{series.directions:.2f}"))
    headings = ("motion", "vp", "from the equations", "lost", "in sticks", "from the samples", "directions seen")
    return Table(headings, "l" * 7, lines)


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
    sweeps: dict[str, dict[float, tuple[NDArray[np.float64], Settings]]] = {
        "radius / size of the set": {r: (every, replace(SETTINGS, radius=r)) for r in radii},
        "delay [samples of 0.2]": {d: (every, replace(SETTINGS, delay=d)) for d in delays},
        "number of samples": {n: (every[:n], SETTINGS) for n in lengths},
    }
    with style.figure(3.6) as figure:
        axes = figure.subplots(2, 3, sharex="col", sharey="row", height_ratios=(3, 1))
        for column, (label, runs) in enumerate(sweeps.items()):
            spectra = [time_series_spectrum(samples, INTERVAL, own).exponents for samples, own in runs.values()]
            _draw_sweep(axes[0, column], axes[1, column], list(runs), spectra)
            axes[1, column].set(xlabel=label, xscale="log")
            axes[1, column].xaxis.set_minor_formatter(NullFormatter())
            for e in chaotic.spectrum.exponents[:-1]:
                axes[0, column].axhline(e, color=style.GREY, lw=0.9)
        axes[0, 0].set(ylabel="exponents", ylim=(-0.32, 0.14))
        axes[1, 0].set(ylabel="the one that\nis -infinity", ylim=(LOWEST, 0))
        axes[0, 2].legend(loc="lower right")
        figure.set_layout_engine("constrained")
    return figure


def _draw_sweep(upper: Axes, lower: Axes, values: Sequence[float], spectra: Sequence[Sequence[float]]) -> None:
    ordered = np.array([sorted(s, reverse=True) for s in spectra])
    colours = (style.VERMILLION, style.BLUE, style.GREEN)
    for i, (colour, marker) in enumerate(zip(colours, "osD", strict=True)):
        upper.plot(values, ordered[:, i], marker=marker, color=colour, label=f"$\\lambda_{i + 1}$")
    lower.plot(values, np.maximum(ordered[:, 3], LOWEST), "v", color=style.BLACK, clip_on=False, zorder=4)


def eq27(system: FilippovSystem, *, printed: bool) -> tuple[sp.Expr, ...]:
    """Eq. (27) with the friction of Eq. (28) in slip, written explicitly in the states and the sign of a rig.

    xi1 ... xi7 are those of the paper, in the rig's parameters.

    Parameters
    ----------
    system : FilippovSystem
        A rig.
    printed : bool
        Whether to use the signs as printed, or ``x2' = -x1 - xi1 (xi2 (x2 + x4) + x3 + T)``.
    """
    m, k1, k2, k3, c1, c2, mu0, delta, a, b, r, vp = sp.symbols("m k1 k2 k3 c1 c2 mu0 delta a b r vp", real=True)
    (x1, x2, x3, x4), (s,) = system.states, system.signs
    omega = sp.sqrt((k1 + k2) / m)
    inertia = m * (a**2 + b**2) / 3
    xi1, xi2, xi3 = k2 / (omega**2 * m), c1 * omega / k2, k2 * r**2 / (omega**2 * inertia)
    xi4, xi5, xi6, xi7 = (k2 + k3) / k2, omega * (c1 + c2) / k2, mu0 * k3 / k2, omega * c2 * mu0 / k2
    friction = s * (1 - xi6 * x3 - xi7 * x4) * mu0 / (1 + delta * s * (x2 - vp))
    coupling = -x3 - friction if printed else x3 + friction
    field = (
        x2,
        -x1 - xi1 * (xi2 * (x2 + x4) + coupling),
        x4,
        xi3 * (-x1 - xi2 * x2 - xi4 * x3 - xi5 * x4),
    )
    return tuple(map(system.numeric, field))


def frictionless_eigenvalues(system: FilippovSystem) -> NDArray[np.complex128]:
    """Eigenvalues of the rig without friction, largest growth rate first."""
    quiet = {system.signs[0]: sp.Integer(0)}
    linear = sp.Matrix([system.numeric(f.xreplace(quiet)) for f in system.field]).jacobian(system.states)
    values = np.linalg.eigvals(np.array(linear.evalf(30), dtype=float)).astype(complex)
    return values[np.argsort(-values.real, kind="stable")]


def moving_belt() -> Findings:
    """Run the block on the moving belt with ``henon`` and ``heyoka``, and compare the runs."""
    problem = shipped_problem("moving_belt")
    problem = replace(problem, until=SETTLED * problem.until)
    times = np.linspace(0.0, float(problem.until), 40001)[:-1]
    run = HENON_SOLVER.prepare(problem, rtol=1e-13, sample_times=times)()
    other = solver("heyoka").prepare(problem, rtol=1e-13, atol=1e-13)()
    assert run.samples is not None
    assert run.sample_modes is not None
    stuck = np.ravel(run.sample_modes) == 0
    (x2,), (surface,) = problem.system.states[1:], map(problem.system.numeric, problem.system.surfaces)
    belt = sp.lambdify(TIME, x2 - surface)(times)
    starts = [t.time for t in run.transitions if t.kind == "stick"]
    ends = [t.time for t in run.transitions if t.kind == "release"]
    lengths = [next(end for end in ends if end > start) - start for start in starts if start < ends[-1]]
    apart = largest_time_difference(run, other)
    drift = float(np.abs(run.samples[stuck, 1] - belt[stuck]).max())
    return Findings(
        {"moving_belt": run.status == "ok" and apart < 1e-10 and drift < 1e-12},
        {"belt_transitions": len(run.transitions), "apart": apart, "drift": drift, "settled": sorted(lengths[-2:])},
    )
