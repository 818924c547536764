"""What of a run with heyoka is heyoka's own: its calls of ``propagate_until``, without the mode switches in Python.

A program that switches modes in compiled code pays these and next to nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from statistics import median
from time import perf_counter
from typing import Any

from henon_ref.baselines.heyoka_taylor import HeyokaTaylor
from henon_ref.harness.campaign.timing import timed
from henon_ref.solver import Solver


@dataclass
class Clock:
    """Time spent in heyoka's calls since it was last set to zero [s]."""

    spent_s: float = 0.0

    def clocked(self, call: Callable[..., Any]) -> Callable[..., Any]:
        """The same call, clocked."""

        def run(*args: Any, **options: Any) -> Any:
            began = perf_counter()
            result = call(*args, **options)
            self.spent_s += perf_counter() - began
            return result

        return run


class _WithOwn:
    """An object of heyoka's with one function of ours; all else is passed on."""

    def __init__(self, theirs: Any, **ours: Callable[..., Any]) -> None:
        object.__setattr__(self, "_theirs", theirs)
        vars(self).update(ours)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._theirs, name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._theirs, name, value)


@dataclass(frozen=True)
class ClockedHeyoka(HeyokaTaylor):
    """heyoka, its own calls clocked."""

    clock: Clock = field(default_factory=Clock, kw_only=True)

    def load(self) -> Any:
        """The module, with integrators whose calls of ``propagate_until`` are clocked."""
        module = super().load()

        def taylor_adaptive(*args: Any, **options: Any) -> _WithOwn:
            made = module.taylor_adaptive(*args, **options)
            return _WithOwn(made, propagate_until=self.clock.clocked(made.propagate_until))

        return _WithOwn(module, taylor_adaptive=taylor_adaptive)


def clocked(solver: Solver) -> ClockedHeyoka | None:
    """The same solver with its calls clocked; None where it is not heyoka."""
    if not isinstance(solver, HeyokaTaylor):
        return None
    return ClockedHeyoka(**{own.name: getattr(solver, own.name) for own in fields(solver)})


def own_part(run: Callable[[], object], clocked_run: Callable[[], object], clock: Clock, *, rounds: int) -> float:
    """Time of the library's own calls over that of a whole run: the median over rounds of one of each.

    Parameters
    ----------
    run, clocked_run : callable
        The same run, without and with clocked calls.
    clock : Clock
        The second one's.
    rounds : int
        One more is made first, to warm up.
    """
    parts = []
    for _ in range(rounds + 1):
        whole = timed(run)
        clock.spent_s = 0.0
        clocked_run()
        parts.append(clock.spent_s / whole)
    return median(parts[1:])
