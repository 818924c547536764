"""Lyapunov exponents from samples of a trajectory: Eqs. (25) and (26) of the paper (Sano and Sawada 1985).

Around every d-th sample the method follows the neighbours in a ball for d samples. The least-squares linear map from
their initial to their final distances, ``A_j = (sum y_{k+d} y_k^T)(sum y_k y_k^T)^-1`` (Eq. 25), approximates the
derivative of the flow. The exponents are the mean logarithmic rates at which the product of the A_j stretches an
orthonormal basis (Eq. 26, with QR instead of Gram and Schmidt).

The samples lie on the attractor and therefore contain the stretching of directions *along* it only. If the dimension
of the attractor is below that of the state space (a curve, a torus), the second sum has no inverse: its small
eigenvalues measure the curvature of the attractor, not another direction. Eigenvectors below a cutoff are left out.
The exponents of the missing directions are then rounding noise; :attr:`TimeSeriesSpectrum.directions` is the number of
directions in the samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from henon_ref.errors import ModelError

Matrix = NDArray[np.float64]
_CHUNK = 2048
"""Number of reference points that are processed together; it bounds the memory of their neighbours."""


@dataclass(frozen=True)
class Settings:
    """Settings of the estimate; no values are right for all samples."""

    radius: float
    """Radius of the ball, relative to the size of the set (root-mean-square distance from the mean)."""
    delay: int
    """Number d of samples between a distance and its image, and between two reference points."""
    least: int = 12
    """Smallest number of neighbours; a ball with fewer is widened."""
    theiler: int = 25
    """Samples within this number of samples in time are not neighbours (Theiler 1986): they are on the same piece of
    orbit."""
    cutoff: float = 0.02
    """A direction is left out if the neighbours' spread in it is below this part of their largest spread."""


@dataclass(frozen=True)
class TimeSeriesSpectrum:
    """An estimate of all Lyapunov exponents from samples."""

    exponents: tuple[float, ...]
    """The n exponents [1/s], in the order of the basis vectors (largest first, up to statistical noise)."""
    directions: float
    """Mean number of directions that the neighbours span; the samples determine only this number of exponents."""


def time_series_spectrum(samples: Matrix, interval: float, settings: Settings) -> TimeSeriesSpectrum:
    """Estimate the Lyapunov exponents of a flow from samples.

    Parameters
    ----------
    samples : ndarray, shape (k, n)
        States at equal intervals of time.
    interval : float
        Time between two samples [s].
    settings : Settings

    Raises
    ------
    ModelError
        If samples are not finite, or too few for the settings.
    """
    samples = np.ascontiguousarray(samples, dtype=float)
    if not np.isfinite(samples).all():
        raise ModelError("samples with gaps: the trajectory ended before the last sample time")
    count, n = samples.shape
    if count - settings.delay < 2 * settings.theiler + 1 + settings.least or settings.least <= n:
        raise ModelError(f"{count} samples are too few for {settings}, or 'least' is not above {n} states")
    spread, moved = _moments(samples, settings)
    values, axes = np.linalg.eigh(spread)
    kept = values > settings.cutoff**2 * values[:, -1:]
    inverse = np.where(kept, 1.0 / np.where(kept, values, 1.0), 0.0)
    maps = moved @ (axes * inverse[:, None, :]) @ axes.transpose(0, 2, 1)
    exponents = _growth(maps) / (settings.delay * interval)
    return TimeSeriesSpectrum(tuple(exponents.tolist()), float(kept.sum(axis=1).mean()))


def _growth(maps: Matrix) -> Matrix:
    """Mean logarithm of the growth of each basis vector per map (Eq. 26), shape (n,)."""
    basis = np.eye(maps.shape[-1])
    diagonals = np.empty(maps.shape[:2])
    for j, matrix in enumerate(maps):
        basis, triangle = np.linalg.qr(matrix @ basis)
        diagonals[j] = np.diag(triangle)
    with np.errstate(divide="ignore"):
        return np.log(np.abs(diagonals)).mean(axis=0)


def _moments(samples: Matrix, settings: Settings) -> tuple[Matrix, Matrix]:
    """Compute both sums of Eq. (25), sum y_k y_k^T and sum y_{k+d} y_k^T, at every reference point, shape (r, n, n)."""
    radius = settings.radius * float(np.sqrt(((samples - samples.mean(axis=0)) ** 2).sum(axis=1).mean()))
    last = len(samples) - settings.delay
    references = np.arange(0, last, settings.delay)
    tree = cKDTree(samples[:last])
    sums = []
    for some in np.array_split(references, -(-len(references) // _CHUNK)):
        near = tree.query_ball_point(samples[some], radius)
        neighbours = [_separated_in_time(found, at, settings) for found, at in zip(near, some.tolist(), strict=True)]
        narrow = [j for j, found in enumerate(neighbours) if len(found) < settings.least]
        if narrow:
            _, ranked = tree.query(samples[some[narrow]], k=settings.least + 2 * settings.theiler + 1)
            for j, found in zip(narrow, ranked, strict=True):
                neighbours[j] = _separated_in_time(found, some[j], settings)[: settings.least]
        which = np.repeat(np.arange(len(some)), list(map(len, neighbours)))
        index, at = np.concatenate(neighbours), some[which]
        y, z = ((samples[index + k] - samples[at + k]).T for k in (0, settings.delay))
        sums.append([[[np.bincount(which, u * v) for v in y] for u in left] for left in (y, z)])
    spread, moved = np.concatenate(sums, axis=-1).transpose(0, 3, 1, 2)
    return spread, moved


def _separated_in_time(found: list[int] | NDArray[np.intp], at: int, settings: Settings) -> NDArray[np.int64]:
    """Return the samples that are not close in time to a reference point."""
    index = np.asarray(found, dtype=np.int64)
    return index[np.abs(index - at) > settings.theiler]
