"""Lyapunov exponents from samples of a trajectory: Eqs. (25) and (26) of the paper (Sano and Sawada 1985).

Around every d-th sample the neighbours in a ball are followed for d samples; the linear map that takes their
distances from one to the other in the sense of least squares, ``A_j = (sum y_{k+d} y_k^T)(sum y_k y_k^T)^-1``
(Eq. 25), stands for the derivative of the flow, and the exponents are the mean logarithmic rates at which
the product of the A_j stretches an orthonormal basis (Eq. 26, with QR for Gram and Schmidt).

The samples lie on the attractor, so they only say how directions *along* it stretch. Where it is thinner than
space (a curve, a torus) the second sum has no inverse: its small eigenvalues measure the curvature of the
attractor, not a direction of its own. Eigenvectors below a cutoff are left out; what the method then returns
for the missing directions is rounding noise, and :attr:`TimeSeriesSpectrum.directions` says how many are real.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from henon_ref.errors import ModelError

Matrix = NDArray[np.float64]
_CHUNK = 2048
"""Reference points looked up at once (bounds the memory that their neighbours take)."""


@dataclass(frozen=True)
class Settings:
    """What the estimate depends on; there is no value that is right for all samples."""

    radius: float
    """Radius of the ball, in units of the set's size: the root-mean-square distance from its mean."""
    delay: int
    """d: samples between a distance and its image, and between two reference points."""
    least: int = 12
    """Neighbours wanted; where the ball holds fewer, it is widened to this many."""
    theiler: int = 25
    """Samples within this distance in time are no neighbours (Theiler 1986): they lie on the same piece of orbit."""
    cutoff: float = 0.02
    """Directions in which the neighbours spread less than this share of their largest spread are left out."""


@dataclass(frozen=True)
class TimeSeriesSpectrum:
    """An estimate of all Lyapunov exponents from samples."""

    exponents: tuple[float, ...]
    """n of them [1/s], in the order of the basis vectors (largest first up to statistical noise)."""
    directions: float
    """Mean number of directions that the neighbours span: how many exponents the samples can say anything about."""
    neighbours: float
    """Median number of neighbours in a ball."""
    widened: float
    """Share of the balls that had to be widened."""
    maps: int
    """Number n_j of linear maps in the product."""
    size: float
    """The set's size, the unit of the radius."""
    settings: Settings


def time_series_spectrum(samples: Matrix, interval: float, settings: Settings) -> TimeSeriesSpectrum:
    """Estimate the Lyapunov exponents of the flow that samples come from.

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
        For samples that are not finite, or too few for the settings.
    """
    samples = np.ascontiguousarray(samples, dtype=float)
    if not np.isfinite(samples).all():
        raise ModelError("samples with gaps: the trajectory ended before the last sample time")
    count, n = samples.shape
    if count - settings.delay < 2 * settings.theiler + 1 + settings.least or settings.least <= n:
        raise ModelError(f"{count} samples are too few for {settings}, or 'least' is not above {n} states")
    size = float(np.sqrt(((samples - samples.mean(axis=0)) ** 2).sum(axis=1).mean()))
    spread, moved, found, widened = _moments(samples, settings, settings.radius * size)
    values, axes = np.linalg.eigh(spread)
    kept = values > settings.cutoff**2 * values[:, -1:]
    inverse = np.where(kept, 1.0 / np.where(kept, values, 1.0), 0.0)
    maps = moved @ (axes * inverse[:, None, :]) @ axes.transpose(0, 2, 1)
    return TimeSeriesSpectrum(
        exponents=tuple((_growth(maps) / (settings.delay * interval)).tolist()),
        directions=float(kept.sum(axis=1).mean()),
        neighbours=float(np.median(found)),
        widened=widened,
        maps=len(maps),
        size=size,
        settings=settings,
    )


def _growth(maps: Matrix) -> Matrix:
    """Mean logarithm of how much each basis vector grows a map (Eq. 26), shape (n,)."""
    basis = np.eye(maps.shape[-1])
    diagonals = np.empty(maps.shape[:2])
    for j, matrix in enumerate(maps):
        basis, triangle = np.linalg.qr(matrix @ basis)
        diagonals[j] = np.diag(triangle)
    with np.errstate(divide="ignore"):
        return np.log(np.abs(diagonals)).mean(axis=0)


def _moments(samples: Matrix, settings: Settings, radius: float) -> tuple[Matrix, Matrix, NDArray[np.int64], float]:
    """Both sums of Eq. (25) for every reference point, neighbours found, share of balls widened."""
    last = len(samples) - settings.delay
    references = np.arange(0, last, settings.delay)
    tree = cKDTree(samples[:last])
    spread, moved, found = [], [], []
    widened = 0
    for some in np.array_split(references, -(-len(references) // _CHUNK)):
        neighbours = list(_neighbours(tree, samples, some, settings, radius))
        counts = np.array([len(near) for near in neighbours])
        narrow = np.flatnonzero(counts < settings.least)
        widened += len(narrow)
        for at, near in zip(narrow, _nearest(tree, samples, some[narrow], settings), strict=True):
            neighbours[at] = near
            counts[at] = len(near)
        both = _sums(samples, some, np.concatenate(neighbours), counts, settings.delay)
        spread.append(both[0])
        moved.append(both[1])
        found.append(counts)
    return np.concatenate(spread), np.concatenate(moved), np.concatenate(found), widened / len(references)


def _neighbours(
    tree: cKDTree, samples: Matrix, references: NDArray[np.int64], settings: Settings, radius: float
) -> Iterator[NDArray[np.int64]]:
    """Samples in the ball around each reference point, those close in time left out."""
    for at, near in zip(references, tree.query_ball_point(samples[references], radius), strict=True):
        index = np.array(near, dtype=np.int64)
        yield index[np.abs(index - at) > settings.theiler]


def _nearest(
    tree: cKDTree, samples: Matrix, references: NDArray[np.int64], settings: Settings
) -> Iterator[NDArray[np.int64]]:
    """The nearest samples that are not close in time, as many as are wanted."""
    if not len(references):
        return
    _, ranked = tree.query(samples[references], k=settings.least + 2 * settings.theiler + 1)
    for at, index in zip(references, ranked, strict=True):
        yield index[np.abs(index - at) > settings.theiler][: settings.least].astype(np.int64)


def _sums(
    samples: Matrix, references: NDArray[np.int64], neighbours: NDArray[np.int64], counts: NDArray[np.int64], delay: int
) -> tuple[Matrix, Matrix]:
    """sum y_k y_k^T and sum y_{k+d} y_k^T over the neighbours of each reference point, each (r, n, n)."""
    which = np.repeat(np.arange(len(references)), counts)
    at = references[which]
    y, z = ((samples[neighbours + k] - samples[at + k]).T for k in (0, delay))
    spread, moved = (np.array([[np.bincount(which, u * v) for v in y] for u in left]) for left in (y, z))
    return spread.transpose(2, 0, 1), moved.transpose(2, 0, 1)
