"""Compiled systems, kept by what they say: an equal system made anew compiles nothing, nor do other values."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import replace
from threading import Lock

from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.prepared_run import order_for
from henon_ref.simulation.system import System

KEPT = 64
"""Systems and orders that are kept compiled; the one not used for the longest time goes first."""

_kept: OrderedDict[tuple[object, int, frozenset[int]], Integrator] = OrderedDict()
_lock = Lock()


def integrator_of(system: System, tolerance: float, open_kinks: frozenset[int] = frozenset()) -> Integrator:
    """What runs a system, with any values of its parameters, at the order of a local error.

    ``open_kinks``: see :class:`henon_ref.modes.system.FilippovSystem`.

    It is compiled the first time that a system of this structure is asked for. One thread compiles at a time; the
    others wait for it.
    """
    key = system.structure, order_for(tolerance), open_kinks
    with _lock:
        if key in _kept:
            _kept.move_to_end(key)
            return _kept[key]
        made = Integrator(replace(system.model, parameters={}, open_kinks=open_kinks), key[1])
        _kept[key] = made
        while len(_kept) > KEPT:
            _kept.popitem(last=False)
        return made
