"""An orthonormal frame of tangent vectors carried along a trajectory, and how fast its vectors grow.

Vectors are made orthonormal again (QR) before they are too nearly parallel for double precision, which their condition
number tells. Between two losses of rank the sum of all logarithms is that of a volume, which is known otherwise: the
integrated divergence along the tangent spaces of the modes, and the volumes' factors of the saltation matrices.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from henon_ref.analysis.saltation import Matrix, rank_lost
from henon_ref.analysis.variational import TangentFlow, TangentTransition
from henon_ref.errors import UnsupportedError
from henon_ref.trajectory import Status, Trajectory

CONDITION = 1e5
"""Condition number of the frame at which it is made orthonormal again."""
TAKEN_BACK = 1e8
"""Condition number at which a stretch is done again, in shorter parts: the last growth has lost half its digits."""
FIRST = 2.0**-20
"""Part of the time ahead that is gone to begin with, before anything of the growth is seen."""
IDENTITY = 1e-8
"""How far the logarithms' sum may be off, relative to the sum of the absolute values of all terms."""
LOCAL_ERROR = IDENTITY / CONDITION
"""Largest local error of a step for that: the frame's condition number multiplies it."""
PARALLEL = 1e-8
"""A vector that a transition leaves with less than this part beside those before it is the one that it takes away."""

TURNED = 1e-3
"""How much the first frame is turned, so that no direction is left out that grows later on."""


class TangentFrame:
    """An orthonormal frame of tangent vectors along a flow, and the logarithms of how they grew.

    Attributes
    ----------
    logs : ndarray, shape (n,)
        Logarithms since the averages began; ``-inf`` for directions that are lost.
    times : list of float
        Times since then [s].
    history : list of ndarray
        ``logs`` over those times [1/s].
    transitions : int
    stuck : float
        Time in which any surface slid [s].
    """

    def __init__(self, flow: TangentFlow, tolerance: float) -> None:
        self.flow, self.tolerance = flow, tolerance
        self.n = len(flow.state)
        flow.vectors = first = _first_frame(flow)
        self.dimension, self.ahead = first.shape[1], 0.0
        self.reset()

    def reset(self) -> None:
        """Begin the averages here, with all directions that the present mode has."""
        self.counted = list(range(self.dimension))
        self.logs = np.where(np.arange(self.n) < self.dimension, 0.0, -np.inf)
        self.volume = _Volume(self.n * self.tolerance)
        self.began = self.last = self.flow.time
        self.stuck = 0.0
        self.transitions = 0
        self.times: list[float] = []
        self.history: list[Matrix] = []

    def run(self, until: float) -> tuple[Status, str]:
        """Go to a time."""
        flow = self.flow
        self.ahead = self.ahead or FIRST * (until - flow.time)
        while flow.time < until:
            begin, saved, slides = flow.time, flow.saved(), 0 in flow.mode
            event = flow.advance(min(begin + self.ahead, until))
            condition, passed = self._condition(), flow.time - begin
            if condition > TAKEN_BACK and begin + passed / 2 > begin:
                flow.go_back(saved)
                self.ahead = passed / 2
                continue
            # As far as the condition number gets at the rate that is seen, and at most twice as far as now.
            growth = math.log(condition) / math.log(CONDITION)
            if growth > 1:
                self.ahead = passed / growth
            elif isinstance(event, Trajectory):
                self.ahead = max(self.ahead, passed / max(growth, 0.5))
            if isinstance(event, Trajectory) and event.status != "ok":
                return event.status, event.reason
            self._orthonormalise()
            if isinstance(event, TangentTransition):
                self._cross(event)
            self._note(slides)
        return "ok", ""

    def _condition(self) -> float:
        vectors = self.flow.vectors[:, : self.dimension]
        if not np.isfinite(vectors).all():
            return math.inf
        sizes = np.linalg.svdvals(vectors)
        return float(sizes[0] / sizes[-1]) if sizes.size and sizes[-1] > 0 else math.inf if sizes.size else 1.0

    def _orthonormalise(self) -> None:
        basis, r = np.linalg.qr(self.flow.vectors[:, : self.dimension])
        grown = np.log(np.abs(np.diag(r)))
        self.volume.add(grown, self.flow.log_volume)
        self._count(grown)
        self.flow.vectors = basis

    def _cross(self, event: TangentTransition) -> None:
        """Take the orthonormal frame through a transition; directions that the mode after has besides are added."""
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
            self.volume = _Volume(self.volume.rounding)
        else:
            self.volume.add(grown, float(np.log(np.abs(np.diag(np.linalg.qr(through)[1]))).sum()))
        self._count(grown)
        flow.vectors = frame = spaces.completed(basis, flow.mode, flow.time, flow.state)
        self.dimension = frame.shape[1]

    def _without_lost(self, vectors: Matrix, lost: int) -> Matrix:
        """The vectors less those that a transition has taken away: each is in the span of those before it."""
        for _ in range(lost):
            sizes = np.abs(np.diag(np.linalg.qr(vectors)[1]))
            small = np.flatnonzero(sizes <= PARALLEL * np.abs(vectors).max())
            k = int(small[0]) if small.size else sizes.size - 1
            vectors = np.delete(vectors, k, axis=1)
            if k < len(self.counted):
                self.logs[self.counted.pop(k)] = -np.inf
        return vectors

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
    """The frame that vectors would have come to, but for :data:`TURNED`, with the start's Jacobian all the time before.

    It begins with the directions that grow fastest; of a linear system the averages are then exact from the start on.
    """
    basis = flow.spaces.basis(flow.mode, flow.time, flow.state)
    rates, vectors = np.linalg.eig(basis.T @ flow.spaces.jacobian(flow.mode, flow.time, flow.state) @ basis)
    real = np.where(rates.imag < 0, vectors.imag, vectors.real)[:, np.argsort(-rates.real, kind="stable")]
    turn = TURNED * np.random.default_rng(0).standard_normal(real.shape)
    return basis @ np.linalg.qr(np.linalg.qr(real)[0] + turn)[0]


@dataclass
class _Volume:
    """How far the logarithms of a frame's growth are from those of its volume, since rank was last lost."""

    rounding: float
    """What a stretch may be off anyhow."""
    off: float = field(default=0.0, init=False)
    terms: float = field(default=0.0, init=False)
    allowed: float = field(default=0.0, init=False)

    def add(self, grown: NDArray[np.float64], volume: float) -> None:
        """Add a stretch; an UnsupportedError where they do not agree."""
        self.off += float(grown.sum()) - volume
        self.terms += float(np.abs(grown).sum()) + abs(volume)
        self.allowed += self.rounding
        if not abs(self.off) <= IDENTITY * self.terms + self.allowed:
            raise UnsupportedError(
                "the tangent vectors' growth is lost in rounding: the sum of its logarithms is off by "
                f"{self.off:.3g} from the integrated divergence, of terms of {self.terms:.3g} altogether"
            )
