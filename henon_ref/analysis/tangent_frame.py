"""Orthonormal frame of tangent vectors along a trajectory, and the growth of its vectors.

The vectors are orthonormalized (QR) before they become too nearly parallel for double precision, as measured by their
condition number. Between two losses of rank, the sum of all logarithms of growth is that of a volume. It is checked
against the integrated divergence in the modes' tangent spaces plus the volume factors of the saltation matrices.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from henon_ref.analysis.saltation import Matrix, Vector, rank_lost
from henon_ref.analysis.variational import TangentFlow, TangentTransition
from henon_ref.errors import UnsupportedError
from henon_ref.modes.mode import Mode
from henon_ref.trajectory import Status, Trajectory

CONDITION = 1e5
"""Condition number of the frame at which it is orthonormalized."""
MAX_CONDITION = 1e8
"""Condition number at which a stretch is repeated in shorter parts: the last growth has lost half its digits."""
FIRST_STRETCH = 2.0**-20
"""First stretch as a part of the total time, before any growth is measured."""
IDENTITY = 1e-8
"""Tolerance of the sum of logarithms, relative to the sum of the absolute values of all terms."""
LOCAL_ERROR = IDENTITY / CONDITION
"""Largest local error of a step for this tolerance: the frame's condition number multiplies it."""
TURNED = 1e-3
"""Size of a random perturbation of the first frame, so that it excludes no direction that grows later."""


class TangentFrame:
    """Orthonormal frame of tangent vectors along a flow, and the logarithms of their growth."""

    def __init__(self, flow: TangentFlow, tolerance: float) -> None:
        self.flow, self.tolerance = flow, tolerance
        self.n = len(flow.state)
        flow.vectors = first = _first_frame(flow)
        self.dimension, self.ahead = first.shape[1], 0.0
        self.reset()

    def reset(self) -> None:
        """Begin the averaging now, with all directions of the present mode."""
        self.counted = list(range(self.dimension))
        self.logs = np.where(np.arange(self.n) < self.dimension, 0.0, -np.inf)
        """Logarithms since the averaging began, shape (n,); ``-inf`` for removed directions."""
        # Sum of the growths less that of the volume, sum of the absolute terms, and allowed rounding errors.
        self.off = self.terms = self.allowed = 0.0
        self.began = self.last = self.flow.time
        self.stuck = 0.0
        """Time in which at least one surface slid [s]."""
        self.transitions = 0
        self.times: list[float] = []
        """Times since the averaging began [s]."""
        self.history: list[Matrix] = []
        """``logs`` divided by those times [1/s]."""

    def run(self, until: float) -> tuple[Status, str]:
        """Advance to a time."""
        flow = self.flow
        self.ahead = self.ahead or FIRST_STRETCH * (until - flow.time)
        while flow.time < until:
            begin, saved, mode = flow.time, flow.saved(), flow.mode
            event = flow.advance(min(begin + self.ahead, until))
            condition, passed = self._condition(), flow.time - begin
            if condition > MAX_CONDITION and begin + passed / 2 > begin:
                flow.go_back(saved)
                self.ahead = passed / 2
                continue
            # Next stretch: until CONDITION at the measured rate, but at most twice the present stretch.
            growth = math.log(condition) / math.log(CONDITION)
            if growth > 1:
                self.ahead = passed / growth
            elif isinstance(event, Trajectory):
                self.ahead = max(self.ahead, passed / max(growth, 0.5))
            if isinstance(event, Trajectory) and event.status != "ok":
                return event.status, event.reason
            if isinstance(event, TangentTransition):
                self._orthonormalise(*event.begin)
                self._cross(event)
            else:
                self._orthonormalise(mode, flow.time, flow.state)
            self._note(0 in mode)
        return "ok", ""

    def _condition(self) -> float:
        vectors = self.flow.vectors[:, : self.dimension]
        if not np.isfinite(vectors).all():
            return math.inf
        sizes = np.linalg.svdvals(vectors)
        if not sizes.size:
            return 1.0
        largest = max(sizes[0], 1.0) if self.dimension < self.n else sizes[0]  # normal rounding errors do not shrink
        return float(largest / sizes[-1]) if sizes[-1] > 0 else math.inf

    def _orthonormalise(self, mode: Mode, time: float, state: Vector) -> None:
        """Orthonormalize the frame in the tangent space of a mode.

        Components normal to a sliding surface are rounding errors, which keep their size while the frame shrinks.
        """
        vectors = self.flow.vectors[:, : self.dimension]
        if self.dimension < self.n:
            along = self.flow.spaces.basis(mode, time, state)
            vectors = along @ (along.T @ vectors)
        basis, r = np.linalg.qr(vectors)
        grown = np.log(np.abs(np.diag(r)))
        self._check(grown, self.flow.log_volume)
        self._count(grown)
        self.flow.vectors = basis

    def _cross(self, event: TangentTransition) -> None:
        """Multiply the frame by the saltation matrix of a transition; add directions that only the next mode has."""
        flow, spaces = self.flow, self.flow.spaces
        self.transitions += 1
        through = event.saltation @ spaces.basis(*event.begin)
        vectors = event.saltation @ flow.vectors[:, : self.dimension]
        lost = self.dimension - spaces.dimension(flow.mode)
        if event.jumps:
            lost = max(lost, rank_lost(through))
        vectors = self._without_lost(vectors, lost)
        basis, r = np.linalg.qr(vectors)
        grown = np.log(np.abs(np.diag(r)))
        if lost > 0:
            self.off = self.terms = self.allowed = 0.0
        else:
            self._check(grown, float(np.log(np.abs(np.diag(np.linalg.qr(through)[1]))).sum()))
        self._count(grown)
        flow.vectors = frame = spaces.completed(basis, flow.mode, flow.time, flow.state)
        self.dimension = frame.shape[1]

    def _without_lost(self, vectors: Matrix, lost: int) -> Matrix:
        """Return the vectors without those that a transition removed: each is in the span of those before it."""
        for _ in range(lost):
            sizes = np.abs(np.diag(np.linalg.qr(vectors)[1]))
            small = np.flatnonzero(sizes <= 1e-8 * np.abs(vectors).max())
            k = int(small[0]) if small.size else sizes.size - 1
            vectors = np.delete(vectors, k, axis=1)
            if k < len(self.counted):
                self.logs[self.counted.pop(k)] = -np.inf
        return vectors

    def _check(self, grown: NDArray[np.float64], volume: float) -> None:
        """Add the growth of a stretch and that of its volume; UnsupportedError if they disagree since the last loss of
        rank."""
        self.off += float(grown.sum()) - volume
        self.terms += float(np.abs(grown).sum()) + abs(volume)
        self.allowed += self.n * self.tolerance  # rounding errors of a stretch
        if not abs(self.off) <= IDENTITY * self.terms + self.allowed:
            raise UnsupportedError(
                "the growth of the tangent vectors is lost in rounding: the sum of its logarithms differs by "
                f"{self.off:.3g} from the integrated divergence, and all absolute terms sum to {self.terms:.3g}"
            )

    def _count(self, grown: NDArray[np.float64]) -> None:
        self.logs[self.counted] += grown[: len(self.counted)]

    def _note(self, slides: bool) -> None:
        now = self.flow.time
        self.stuck += now - self.last if slides else 0.0
        self.last = now
        if now > self.began:
            self.times.append(now - self.began)
            self.history.append(self.logs / (now - self.began))


def _first_frame(flow: TangentFlow) -> Matrix:
    """Return the frame to which vectors converge under the Jacobian of the start, perturbed by :data:`TURNED`.

    The directions of largest growth are first; the averages of a linear system are then exact from the start.
    """
    basis = flow.spaces.basis(flow.mode, flow.time, flow.state)
    rates, vectors = np.linalg.eig(basis.T @ flow.spaces.jacobian(flow.mode, flow.time, flow.state) @ basis)
    real = np.where(rates.imag < 0, vectors.imag, vectors.real)[:, np.argsort(-rates.real, kind="stable")]
    turn = TURNED * np.random.default_rng(0).standard_normal(real.shape)
    return basis @ np.linalg.qr(np.linalg.qr(real)[0] + turn)[0]
