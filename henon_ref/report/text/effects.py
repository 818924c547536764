"""The effects of a scene: the operations that each adds, and what they cost in a step."""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.campaign.results import ReadingResult
from henon_ref.casefile.assembly import Scene
from henon_ref.filippov.system import FilippovSystem
from henon_ref.henon.prepared_run import order_for
from henon_ref.table import Table
from henon_ref.taylor.llvm.count import count
from henon_ref.taylor.llvm.expansion import expansion_ir
from henon_ref.taylor.tape import build_tape

MOST_ROWS = 24
"""Connections that have a row each; where there are more, a row is all of a kind."""
HEADINGS = ("effect", "operations", "floating-point operations a step", "of all")
EXPLAINED = (
    "Operations that are gone where the effect is left out: on the tape of slip, and in the machine code of one Taylor "
    "expansion of order {order}. What two effects share goes with neither."
)


def effect_table(result: ReadingResult) -> tuple[Table, str] | None:
    """A table of the effects of a reading's scene, and what its columns mean; None where there is no scene."""
    scene = result.reading.scene
    if scene is None or not scene.connections:
        return None
    order = order_for(0.1 * min(result.reading.tolerances))
    whole = _work(scene.system(), order)
    rows = []
    for label, numbers in _effects(scene):
        rest = _work(scene.without(numbers).system(), order)
        operations, floating = whole[0] - rest[0], whole[1] - rest[1]
        rows.append((f"`{label}`", str(operations), str(floating), f"{100 * floating / whole[1]:.0f} %"))
    rows.append(("*all*", str(whole[0]), str(whole[1]), "100 %"))
    return Table(HEADINGS, "lrrr", rows), EXPLAINED.format(order=order)


def _effects(scene: Scene) -> list[tuple[str, list[int]]]:
    """Label and connections of every row."""
    if len(scene.connections) <= MOST_ROWS:
        return [(connection.label, [number]) for number, connection in enumerate(scene.connections)]
    kinds: dict[str, list[int]] = {}
    for number, connection in enumerate(scene.connections):
        kinds.setdefault(connection.kind, []).append(number)
    return [(f"{kind} ({len(numbers)} of them)", numbers) for kind, numbers in kinds.items()]


def _work(system: FilippovSystem, order: int) -> tuple[int, int]:
    """Operations on the tape of slip, and floating-point operations of its expansion."""
    equations = system.shared_equations(frozenset())
    guards: Sequence[object] = [guard.expression for guard in equations.guards]
    tape = build_tape(system.states, equations.field, guards)
    operations = sum(number for name, number in tape.counts.items() if name not in ("state", "constant"))
    return operations, count(expansion_ir(tape, len(system.states), order, "expansion"))
