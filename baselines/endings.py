"""Why a library gets no further: a blow-up, the end of the model, or a failure of its own."""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.baselines.flow import LIMIT, Stop
from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.mode_table import ModeEntry
from henon_ref.baselines.record import Record
from henon_ref.baselines.restart import MARGIN
from henon_ref.modes.callables import ARITHMETIC, Scalar
from henon_ref.trajectory import Trajectory

GROWTH = 8.0
"""A step that underflows means blow-up only where the state has grown this much since the mode began ..."""
RUSH = 1e-3
"""... and would change by this part within 1024 units in the last place of the time."""


def blown_up(field: Scalar, began: Sequence[float], t: float, x: Sequence[float]) -> bool:
    """Whether a state at which the steps underflow is on its way out of every bound.

    It is where some component has grown since ``began`` and would change by a good part of itself within the
    resolution of time; at a pole or an end of the field it would not.
    """
    try:
        rates = field(t, *x)
    except ARITHMETIC:
        return False
    instant = 1024.0 * EPSILON * abs(t)
    grown = GROWTH * max(abs(v) for v in began)
    return any(abs(v) > grown and abs(f) * instant > RUSH * abs(v) for v, f in zip(x, rates, strict=True))


def ended(
    record: Record, entry: ModeEntry, began: Sequence[float], stop: Stop, accuracy: tuple[float, float]
) -> Trajectory:
    """Tell a blow-up, and the end of the model, from a library's other failures."""
    mode, t, x = entry.model.mode, stop.t, stop.x
    if stop.status == "diverged" or any(abs(v) > LIMIT for v in x):
        return record.finish("diverged", t, x, mode, stop.reason or f"the state passed {LIMIT:g} at t = {t:.17g}")
    if expression := _model_ends(entry.model, t, x, accuracy):
        return record.finish("invalid", t, x, mode, f"the model ends: {expression} fell to 0 at t = {t:.17g}")
    if blown_up(entry.model.field, began, t, x):
        return record.finish("diverged", t, x, mode, f"the state blows up at t = {t:.17g}: {stop.reason}")
    return record.finish("failed", t, x, mode, record.explained("failed", stop.reason))


def _model_ends(model: ModeFunctions, t: float, x: Sequence[float], accuracy: tuple[float, float]) -> str:
    """A ``valid`` expression that is zero within the tolerances where a library gets no further; empty if none is.

    Nothing need have a value behind it, so that no step leads past the root.
    """
    for k, guard in enumerate(model.guards):
        try:
            value = model.guard[k](t, *x)[0]
        except ARITHMETIC:
            continue
        if guard.kind == "valid" and abs(value) <= MARGIN * model.size(k, t, x, *accuracy):
            return str(model.system.valid[guard.index])
    return ""
