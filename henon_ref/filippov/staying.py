"""Points at which a run stays on a surface that it does not slide on: rest exactly on a kink, say.

No slip leaves the surface then, and no mode is consistent by the rule of :mod:`henon_ref.filippov.selection`. Where the
slips that stay have the same motion, to all derivatives that are looked at, it is the run's, in either of them: no
transition. Where they have not, so that the field jumps along the motion, every mean of the two sides is one as well
(Filippov, 1988, Sec. 4), and the future is not unique.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

from henon_ref.errors import ModelError
from henon_ref.filippov.contact_loops import Relation, relations
from henon_ref.filippov.decision import Decision, with_entries
from henon_ref.filippov.modes import Mode, mode_text
from henon_ref.filippov.system import FilippovSystem
from henon_ref.text import listed

Staying = Callable[[Mode], frozenset[int] | None]
"""Mode -> surfaces that its own field stays on to all derivatives; None where it is not consistent otherwise."""
SameMotion = Callable[[Mode, Mode], bool]
"""Whether two modes have the same motion from the point."""


def _unsettled(system: FilippovSystem, relation: Relation) -> bool:
    """Whether surfaces that depend on each other are no loop of contacts, and more than one surface written twice."""
    plain = [i for i in relation if i not in system.overrides]
    return len(relation) > 2 and bool(plain) and all(_slides(system, i) for i in plain)


def _slides(system: FilippovSystem, index: int) -> bool:
    """Whether a surface can be slid on by itself, which a continuous kink cannot."""
    try:
        system.shared_equations(frozenset((index,)))
    except ModelError:
        return False
    return True


def staying_mode(
    system: FilippovSystem, mode: Mode, active: Sequence[int], staying: Staying, same: SameMotion, where: str
) -> Decision | None:
    """What follows where no mode leaves some surfaces; None where it is not that which keeps every mode out.

    Parameters
    ----------
    system : FilippovSystem
    mode : Mode
        Before the point: the sign of a surface that the run stays on is kept, +1 where it has none.
    active : sequence of int
        Surfaces that the point is on.
    staying, same : callable
    where : str
        The point, as messages have it.
    """
    tied = [relation for relation in relations(system, tuple(active)) if _unsettled(system, relation)]
    if tied:
        names = listed([system.sign_names[i] for i in sorted(tied[0])])
        return Decision(
            "none",
            None,
            f"no mode is consistent {where}: the surfaces of {names} depend on each other, and "
            "their signs do not act on them as forces and counterforces do",
        )
    kept: frozenset[int] = frozenset()
    found: list[Mode] = []
    for choice in product(*(system.entries_from(mode[i], i) for i in active)):
        candidate = with_entries(mode, active, choice)
        surfaces = staying(candidate)
        if surfaces and not any(
            system.rests(i) for i in surfaces
        ):  # a body on such a surface rests, and that is a mode
            kept |= surfaces
            found.append(candidate)
    if not found:
        return None
    if not all(same(found[0], other) for other in found[1:]):
        modes = " or ".join(mode_text(each, system.sign_names) for each in found)
        return Decision("nonunique", None, f"the future is not unique {where}: {modes}")
    own = [i for i in active if i in kept]
    return Decision("unique", with_entries(found[0], own, [mode[i] or 1 for i in own]))
