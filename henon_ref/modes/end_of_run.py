"""Signs of the surfaces where a run ended: its state is off the surfaces that hold there by the error of the run."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING

import sympy as sp

from henon_ref.modes.arithmetic import DOUBLES, growth
from henon_ref.modes.callables import ARITHMETIC
from henon_ref.modes.kinks import hidden
from henon_ref.modes.mode import Mode, replaced

if TYPE_CHECKING:
    from henon_ref.modes.mode_evaluation import TapePoint


def signs_in_mode(
    at: TapePoint, surfaces: Sequence[int], given: Mapping[int, int], part: float
) -> tuple[list[int], dict[int, int]]:
    """Return the signs of the surfaces in a given mode, and the entries of this mode that hold.

    The sign is 0 where it contradicts the mode and the state is off the surface by no more than the error of a run
    (:func:`is_zero_up_to_error`). Entries that do not hold are those of hidden kinks with another sign, and rest on a
    stop on which the state moves.
    """
    mode, signs, kept = tuple(given.get(i, sign) for i, sign in enumerate(surfaces)), list(surfaces), dict(given)
    for i, entry in given.items():
        if signs[i] not in (0, entry):
            if hidden(at.system, i, mode):
                del kept[i]
            elif is_zero_up_to_error(at, mode, i, part):
                signs[i] = 0
        elif entry == signs[i] == 0 and at.system.rests(i) and not is_zero_up_to_error(at, mode, i, part):
            del kept[i]
    return signs, kept


def held_signs(at: TapePoint, signs: Sequence[int | None], held: Collection[int], part: float) -> list[int | None]:
    """Return signs with 0 for the surfaces that held before, where the state is off them by no more than an error."""
    mode = tuple(0 if i in held else 1 if sign is None else sign for i, sign in enumerate(signs))
    mode = mode[: len(at.system.surfaces)]
    return [0 if i in held and is_zero_up_to_error(at, mode, i, part) else sign for i, sign in enumerate(signs)]


def is_zero_up_to_error(at: TapePoint, mode: Mode, index: int, part: float) -> bool:
    """Check whether a surface's function (on a stop, its speed, too) is zero up to the error of a run.

    Beside the surface, it is at most ``part`` of the sum of its terms' sizes, or of the largest term of its Taylor
    series on the time scale of the series.
    """
    system, first = at.system, 2 if at.system.rests(index) and mode[index] == 0 else 1
    size = sum(map(abs, at.values(sp.Add.make_args(system.surfaces[index]), mode) or ()))
    for beside in (replaced(mode, index, side) for side in ((mode[index],) if mode[index] else (1, -1))):
        try:
            for guard, series in zip(at.guards(beside) or (), at.series(beside)[0], strict=False):
                if guard.kind != "surface" or guard.index != index:
                    continue
                rates = [growth(series, k) for k in range(1, len(series) // 2)]  # from low orders that are noise: large
                order = DOUBLES.leading(series, 0, min(filter(None, rates), default=1.0), size, part)
                if order is None or order >= first:
                    return True
        except ARITHMETIC:
            continue
    return False
