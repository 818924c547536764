"""Outline of a case file: name, title, tags, numbers of states and surfaces; the equations are read only if needed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from henon_ref.casefile.yaml_file import read_yaml
from henon_ref.errors import CaseError
from henon_ref.expressions.grammar import NOT_STATES, may_have_kinks
from henon_ref.system.tree import MappingNode, Node, ScalarNode, SequenceNode, child, merged

CONTACTS = ("friction", "stop")
"""Kinds of connections that create a surface."""


@dataclass(frozen=True)
class Outline:
    """Outline of a case; ``states`` and ``surfaces`` are their numbers in each reading."""

    name: str
    title: str
    tags: tuple[str, ...]
    readings: int
    states: tuple[int, ...]
    surfaces: tuple[int, ...]


def outline(path: Path) -> Outline:
    """Return the outline of a case file; CaseError if it is not YAML, or has no name, title or model."""
    tree = read_yaml(path)
    readings = list(_readings(tree))
    name, title = (_text(tree, key, path) for key in ("name", "title"))
    tags = dict.fromkeys(tag for reading in readings for tag in _items(reading.entries.get("tags")))
    models = (reading.entries[key] for reading in readings for key in ("system", "scene") if key in reading.entries)
    if any(map(_may_hold_kink, models)):  # kinks become surfaces; to count them the equations must be read
        from henon_ref.casefile.case import load_case  # imports SymPy, needed here only

        systems = [reading.problem.system for reading in load_case(path).readings]
        sizes = [(len(system.states), len(system.surfaces)) for system in systems]
    else:
        sizes = [_sizes(reading, path) for reading in readings]
    states, surfaces = zip(*sizes, strict=True)
    return Outline(name, title, tuple(tags), len(readings), states, surfaces)


def _readings(tree: MappingNode) -> Iterator[MappingNode]:
    """Yield the tree of each reading, its overrides applied."""
    overrides = tree.entries.get("readings")
    if not isinstance(overrides, MappingNode):
        yield tree
        return
    for own in overrides.entries.values():
        yield merged(tree, own) if isinstance(own, MappingNode) else tree


def _text(tree: MappingNode, key: str, path: Path) -> str:
    node = tree.entries.get(key)
    if not isinstance(node, ScalarNode) or node.value is None:
        raise CaseError(f"the key '{key}' is missing at the top", file=str(path))
    return " ".join(node.text.split())


def _items(node: Node | None) -> Iterator[str]:
    for item in node.items if isinstance(node, SequenceNode) else ():
        if isinstance(item, ScalarNode):
            yield item.text


def _sizes(reading: MappingNode, path: Path) -> tuple[int, int]:
    """Return the numbers of states and surfaces of a reading."""
    system, initial = (reading.entries.get(key) for key in ("system", "initial"))
    if isinstance(system, MappingNode):
        states, surfaces = (system.entries.get(key) for key in ("state", "surfaces"))
        if isinstance(states, SequenceNode) and isinstance(surfaces, MappingNode):
            return len(states.items), len(surfaces.entries)
    elif isinstance(initial, MappingNode):  # the states of a scene are the keys of 'initial'
        connections = child(reading, ("scene", "connections"))
        entries = connections.items if isinstance(connections, SequenceNode) else ()
        kinds = [kind for entry in entries if isinstance(entry, MappingNode) for kind in entry.entries]
        return sum(key not in NOT_STATES for key in initial.entries), sum(kind in CONTACTS for kind in kinds)
    raise CaseError("the case has no model: give 'system' or 'scene', and 'initial'", file=str(path))


def _may_hold_kink(node: Node) -> bool:
    """Check whether an expression of a model may have a kink or a jump."""
    if isinstance(node, MappingNode):
        return "normal" in node.entries or any(map(_may_hold_kink, node.entries.values()))
    return any(map(_may_hold_kink, node.items)) if isinstance(node, SequenceNode) else may_have_kinks(node.text)
