"""The compiled closer look, for tests: on a system with one mode that matters, at a doubtful event of a run."""

from __future__ import annotations

from typing import Any

from henon_ref.henon import registers as k
from henon_ref.henon.apart import load, table
from henon_ref.henon.near import look_near
from henon_ref.henon.near_program import NearPrograms
from henon_ref.henon.views import row_of
from henon_ref.jit import njit
from henon_ref.model.modes import Mode
from henon_ref.model.system import FilippovSystem


@njit()
def _look(floats, integers, layout):  # type: ignore[no-untyped-def]
    return look_near(row_of(floats), row_of(integers), layout)


def look(system: FilippovSystem, mode: Mode, floats: Any, integers: Any, layout: Any) -> int:
    """Outcome of :func:`henon_ref.henon.near.look_near`; every guard has its place."""
    programs = NearPrograms(system, lambda mode: range(len(system.equations(mode).guards)))
    layout[0, k.T_LOOK] = programs.address(mode)
    for place in (k.A_LOOK, k.A_QUAD, k.A_FACTORED, k.A_START):
        load(place)
    integers[k.I_APART], integers[k.I_BLOCK] = table(), 1
    integers[k.I_STATES], integers[k.I_GUARDS] = (len(floats) - k.F_STATE) // 2, (len(integers) - k.I_SIZE) // 2
    return int(_look(floats, integers, layout))
