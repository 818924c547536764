"""A truth: reference transitions, each in decimal digits with a radius, and how they were come by."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, groupby

from henon_ref.errors import HenonRefError
from henon_ref.harness.score.reference import NearGraze, ReferenceTransition, split_double
from henon_ref.trajectory import Status

OUT_OF_TIME = "the truth's time limit passed"
"""Begin of the reason of a truth that has been cut short by it."""


class TruthError(HenonRefError):
    """Two routes to the truth contradict each other, so that there is none to store."""


@dataclass(frozen=True)
class Route:
    """What one way of computing the truth found."""

    method: str
    """In words, with the library: ``heyoka 7.13.2, Taylor``."""
    bits: tuple[int, ...]
    """Precisions it ran at, the one that the digits come from first."""
    seconds: float
    """Time taken [s]."""
    status: Status
    """How the exact run ends: ``ok``, ``diverged``, ``nonunique``, ``invalid``, or ``failed``."""
    reason: str
    """Why the status is not ``ok``."""
    end_digits: str
    """Every transition up to this time is known [s]: the horizon, or where the run ends."""
    end_radius: float
    transitions: tuple[ReferenceTransition, ...]
    near_grazes: tuple[NearGraze, ...] = ()
    undecided: str = ""
    """What kept it from going on, where it is the method and not the system that ends the run."""
    accumulates: bool = False
    """Transitions accumulate at the end; only those far enough apart for a double are listed."""


@dataclass(frozen=True)
class Truth:
    """The reference of one reading."""

    case: str
    reading: str
    mathematics_hash: str
    """Hash of the reading's mathematics that this is the truth of."""
    status: Status
    reason: str
    end_digits: str
    """Every transition up to this time is known [s]: the horizon, or where the exact run ends."""
    end_radius: float
    transitions: tuple[ReferenceTransition, ...]
    near_grazes: tuple[NearGraze, ...]
    methods: tuple[tuple[str, tuple[int, ...], float], ...]
    """(method, bits, seconds taken) of every route, the one that the digits come from first."""
    certified: bool
    """Every transition has a proven radius, and it is proven that there is no other."""
    uncertified_because: str = ""
    """Why it is not certified."""

    @cached_property
    def end_time(self) -> float:
        """Where the exact run ends [s]: the horizon, or before it."""
        return split_double(self.end_digits)[0]

    @property
    def radius(self) -> float:
        """Largest radius of its transition times [s]; errors below it cannot be claimed."""
        return max((t.radius for t in self.transitions), default=0.0)

    @property
    def proven(self) -> int:
        """How many transitions have a proven radius."""
        return sum(t.proven for t in self.transitions)


def instants(transitions: tuple[ReferenceTransition, ...]) -> list[range]:
    """Indices of the transitions of each instant (several surfaces may change at one)."""
    sizes = [len(list(g)) for _, g in groupby(transitions, lambda t: (t.time_digits, t.from_mode, t.to_mode))]
    return [range(end - size, end) for size, end in zip(sizes, accumulate(sizes), strict=True)]
