"""A truth: reference transitions in decimal digits with radii, and the methods that computed them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, groupby

from henon_ref.errors import HenonRefError
from henon_ref.harness.score.reference import NearGraze, ReferenceTransition, split_double
from henon_ref.trajectory import Status

OUT_OF_TIME = "the truth's time limit passed"
"""Start of the reason of a truth that a time limit ended early."""


class TruthError(HenonRefError):
    """Two routes to the truth contradict each other, so that no truth can be stored."""


@dataclass(frozen=True)
class Route:
    """Result of one method of computing the truth."""

    method: str
    """Name of the method with its library: ``heyoka 7.13.2, Taylor``."""
    bits: tuple[int, ...]
    """Working precisions, the one that the digits come from first."""
    seconds: float
    """Time taken [s]."""
    status: Status
    """How the exact run ends: ``ok``, ``diverged``, ``nonunique``, ``invalid``, or ``failed``."""
    reason: str
    end_digits: str
    """End of the known part of the run [s]: the horizon, or the end of the run."""
    end_radius: float
    transitions: tuple[ReferenceTransition, ...]
    near_grazes: tuple[NearGraze, ...] = ()
    undecided: str = ""
    """Reason why the method stopped before the end of the run; empty if it did not."""
    accumulates: bool = False
    """Whether transitions accumulate at the end; only those that differ in double precision are listed."""


@dataclass(frozen=True)
class Truth:
    """The reference of one reading."""

    case: str
    reading: str
    mathematics_hash: str
    """Hash of the mathematics that the truth belongs to."""
    status: Status
    reason: str
    end_digits: str
    """End of the known part of the run [s]: the horizon, or the end of the exact run."""
    end_radius: float
    transitions: tuple[ReferenceTransition, ...]
    near_grazes: tuple[NearGraze, ...]
    methods: tuple[tuple[str, tuple[int, ...], float], ...]
    """(method, bits, seconds taken) of every route, the route that the digits come from first."""
    certified: bool
    """Whether every transition has a proven radius and the list is proven to be complete."""
    uncertified_because: str = ""

    @cached_property
    def end_time(self) -> float:
        """End of the known part of the exact run [s]."""
        return split_double(self.end_digits)[0]

    @property
    def radius(self) -> float:
        """Largest radius of the transition times [s], a lower bound of every error that can be measured."""
        return max((t.radius for t in self.transitions), default=0.0)

    @property
    def proven(self) -> int:
        """Number of transitions with a proven radius."""
        return sum(t.proven for t in self.transitions)


def instants(transitions: tuple[ReferenceTransition, ...]) -> list[range]:
    """Indices of the transitions of each instant (several surfaces may change at one)."""
    sizes = [len(list(g)) for _, g in groupby(transitions, lambda t: (t.time_digits, t.from_mode, t.to_mode))]
    return [range(end - size, end) for size, end in zip(sizes, accumulate(sizes), strict=True)]
