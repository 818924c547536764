"""Decision about the mode that follows an event, and the messages of refusals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.modes.equations import Guard, Refusal
from henon_ref.modes.mode import Mode, mode_text, replaced
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME


@dataclass(frozen=True)
class Decision:
    """Mode that follows an event, or the reason why the run ends."""

    status: Refusal | Literal["unique"]
    mode: Mode | None
    reason: str = ""

    @property
    def ending(self) -> Literal["nonunique", "invalid", "failed"]:
        """Status of a run that ends because no mode follows."""
        return self.status if self.status in ("nonunique", "invalid") else "failed"


def several(system: FilippovSystem, found: Sequence[Mode], time: str) -> Decision:
    """Return the refusal for more than one consistent mode."""
    modes = _modes_text(tuple(found), system.sign_names)
    return Decision("nonunique", None, f"the future is not unique at t = {time}: {modes}")


@lru_cache(maxsize=64)
def _modes_text(modes: tuple[Mode, ...], signs: tuple[str, ...]) -> str:
    return " or ".join(mode_text(mode, signs) for mode in modes)


def explained(refusal: Decision, system: FilippovSystem, mode: Mode, surfaces: tuple[int, ...]) -> Decision:
    """Return a refusal with the property of the surfaces that leaves the mode open, if one is found."""
    words = _powers(system, surfaces)
    if refusal.status == "none":
        try:
            system.equations(with_entries(mode, surfaces, (0,) * len(surfaces)))
        except ModelError as error:
            words += f"; {error}"
    return replace(refusal, reason=refusal.reason + words) if words else refusal


@lru_cache(maxsize=64)
def _powers(system: FilippovSystem, surfaces: tuple[int, ...]) -> str:
    """Return the message about surfaces whose gradient vanishes on them."""
    words = ""
    for i in surfaces:
        powers = [factor.as_base_exp() for factor in sp.Mul.make_args(system.surfaces[i])]
        if any(base.free_symbols & {TIME, *system.states} and e.is_number and e > 1 for base, e in powers):
            name = system.sign_names[i]
            words += f"; the surface of {name} has a repeated factor, so that its gradient vanishes there"
    return words


def ended(system: FilippovSystem, mode: Mode, hits: Sequence[Guard], time: str) -> Decision | None:
    """Return why the run ends at these guards of a mode; None if none of them ends it."""
    for guard in hits:
        if guard.ends:
            return Decision(guard.ends, None, f"{_end(system, mode, guard)} t = {time}")
    return None


_text = lru_cache(maxsize=64)(str)
"""Text of an expression; cached, since printing takes longer than most runs that end there."""


def _end(system: FilippovSystem, mode: Mode, guard: Guard) -> str:
    if guard.kind == "valid":
        return f"the model ends: {_text(system.valid[guard.index])} fell to 0 at"
    if guard.kind == "surface":
        name = system.sign_names[guard.index]
        value = "it had no value at the start; reached at" if system.open_kinks else "it has no value before"
        return f"beyond the surface of {name} the field uses a kink whose sign is undecided: {value}"
    names = ", ".join(name for name, s in zip(system.sign_names, mode, strict=True) if s == 0)
    if guard.ends == "nonunique":
        return f"the future is not unique: sliding on the intersection of {names} does not attract beyond"
    return f"it is undecided whether sliding on the intersection of {names} attracts beyond"


def with_entries(mode: Mode, active: Sequence[int], choice: Sequence[int]) -> Mode:
    for index, value in zip(active, choice, strict=True):
        mode = replaced(mode, index, value)
    return mode


def kept_entries(mode: Mode, found: Sequence[Mode], surfaces: Sequence[int]) -> Mode:
    """Return, of several modes with the same motion, the one in which surfaces keep their entries of ``mode``.

    An entry 0 becomes +1. The first mode if this one is not among them: the field leads away from a surface there.
    """
    kept = with_entries(found[0], surfaces, [mode[i] or 1 for i in surfaces])
    return kept if kept in found else found[0]
