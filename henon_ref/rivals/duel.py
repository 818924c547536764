"""What is timed on one reading: the reference, heyoka and the cheapest of all others, by what the reports say."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from henon_ref import registry
from henon_ref.columns import Row
from henon_ref.price.timer import in_turn
from henon_ref.report.ranking import name, number, right
from henon_ref.report.ratios import ERRORS, FIRST, SECOND
from henon_ref.score.settings import Setting
from henon_ref.score.worker import Stages
from henon_ref.trajectory import Problem

SECONDS, FEWEST, MOST = 0.4, 5, 60
"""Time that the runs of a reading may take in all, and how often each is run."""
TURN = 1e-3
"""Seconds for which a short run is repeated when it is its turn."""
PREPARE_SECONDS = 300.0
"""Time that their preparation may take [s]."""
TIMED = "timed"
"""Stage of the message with the ratios."""

Entry = tuple[str, Setting]
"""A solver at a setting."""


@dataclass(frozen=True)
class Ratio:
    """The reference against another solver on one reading, each at its cheapest setting within a bound."""

    error_s: float | None
    """Bound on the worst error [s]; None where there is no transition to time."""
    rival: str
    setting: Setting
    """The reference's setting, and the rival's."""
    rival_setting: Setting
    wall_s: float
    """Median of the reference's times, and of the rival's [s]."""
    rival_wall_s: float
    ratio: float
    """The reference's time over the rival's, median over the rounds."""
    rounds: int


@dataclass(frozen=True)
class Duel:
    """Time a reading's rivals in turn."""

    reading: str
    problem: Problem
    pairs: tuple[tuple[float | None, Entry, Entry], ...]
    """Bound, the reference, a rival."""
    wall_s: float
    """Time that one round takes, by the reports [s]."""
    deadline: float
    """Seconds that one run may take."""

    @property
    def rounds(self) -> int:
        """How often each is run."""
        return min(max(int(SECONDS / self.wall_s), FEWEST), MOST)

    @property
    def seconds(self) -> float:
        return PREPARE_SECONDS + 10.0 * (self.rounds + 1) * self.wall_s

    def stages(self) -> Stages:
        entries = dict.fromkeys(entry for _, *pair in self.pairs for entry in pair)
        runs = {
            (solver, setting): registry.solver(solver).prepare(
                self.problem, rtol=setting.rtol, atol=setting.atol, step=setting.step, deadline=self.deadline
            )
            for solver, setting in entries
        }
        times = in_turn(runs, rounds=self.rounds, turn=TURN)
        yield (
            TIMED,
            [
                Ratio(
                    error,
                    rival[0],
                    own[1],
                    rival[1],
                    times.median(own),
                    times.median(rival),
                    times.ratio(own, rival),
                    self.rounds,
                )
                for error, own, rival in self.pairs
            ],
        )


def duel(rows: Sequence[Row], reading: str, problem: Problem, deadline: float) -> Duel | None:
    """What is to be timed on a reading with these rows; None where nobody but the reference has it right, or not it."""
    pairs = list(_pairs(rows))
    if not pairs:
        return None
    walls = {_entry(row): number(row, "wall_s") for _, *pair in pairs for row in pair}
    return Duel(
        reading,
        problem,
        tuple((error, _entry(own), _entry(rival)) for error, own, rival in pairs),
        sum(walls.values()),
        deadline,
    )


def _pairs(rows: Sequence[Row]) -> Iterator[tuple[float | None, Row, Row]]:
    """Bound, the reference's cheapest row within it, and a rival's: heyoka's, and that of the cheapest other."""
    idle = [row for row in rows if row["verdict"] == "right" and row["reference_transitions"] == 0]
    for error in (None,) if idle else ERRORS:
        able = idle if error is None else [row for row in right(rows) if number(row, "max_time_error_s") <= error]
        own = _cheapest([row for row in able if name(row) == FIRST])
        others = [row for row in able if name(row) != FIRST]
        if own is None:
            continue
        rivals = (_cheapest([row for row in others if name(row) == SECOND]), _cheapest(others))
        for rival in {name(row): row for row in rivals if row is not None}.values():
            yield error, own, rival


def _cheapest(rows: Sequence[Row]) -> Row | None:
    return min((row for row in rows if row["wall_s"]), key=lambda row: number(row, "wall_s"), default=None)


def _entry(row: Row) -> Entry:
    return name(row), Setting(*(row[column] for column in ("rtol", "atol", "step_s")))  # type: ignore[arg-type]
