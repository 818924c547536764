"""What a case file says at a glance, read as YAML alone unless its expressions have kinks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from henon_ref.casefile.grammar import NOT_STATES, may_have_kinks
from henon_ref.casefile.tree import MappingNode, Node, ScalarNode, SequenceNode, child, merged
from henon_ref.casefile.yaml_file import read_yaml
from henon_ref.errors import CaseError

SURFACES_OF = {"friction": 1, "stop": 1}
"""Kind of connection -> the surfaces that it makes."""


@dataclass(frozen=True)
class Outline:
    """A case at a glance."""

    name: str
    title: str
    tags: tuple[str, ...]
    readings: int
    states: tuple[int, ...]
    """How many, in each reading."""
    surfaces: tuple[int, ...]
    """How many, in each reading."""


def outline(path: Path) -> Outline:
    """A case file at a glance."""
    tree = read_yaml(path)
    readings = list(_readings(tree))
    name, title = (_text(tree, key, path) for key in ("name", "title"))
    tags = dict.fromkeys(tag for reading in readings for tag in _items(reading.entries.get("tags")))
    sizes = _read_sizes(path) if any(map(_has_kinks, readings)) else [_sizes(reading, path) for reading in readings]
    return Outline(
        name, title, tuple(tags), len(readings), tuple(states for states, _ in sizes), tuple(s for _, s in sizes)
    )


def _readings(tree: MappingNode) -> Iterator[MappingNode]:
    """The tree of each reading, its overrides laid over the case."""
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
    """States and surfaces of a reading."""
    system, initial = (reading.entries.get(key) for key in ("system", "initial"))
    if isinstance(system, MappingNode):
        states, surfaces = (system.entries.get(key) for key in ("state", "surfaces"))
        if isinstance(states, SequenceNode) and isinstance(surfaces, MappingNode):
            return len(states.items), len(surfaces.entries)
    elif isinstance(initial, MappingNode):  # a scene's states stand in its start
        return sum(key not in NOT_STATES for key in initial.entries), _contacts(reading)
    raise CaseError("there is no model: give 'system' or 'scene', and 'initial'", file=str(path))


def _has_kinks(reading: MappingNode) -> bool:
    """Whether an expression of a model may make surfaces of its own, which only who reads it can count."""
    return any(_holds_kink(reading.entries[key]) for key in ("system", "scene") if key in reading.entries)


def _holds_kink(node: Node) -> bool:
    if isinstance(node, MappingNode):
        return "normal" in node.entries or any(_holds_kink(child) for child in node.entries.values())
    if isinstance(node, SequenceNode):
        return any(_holds_kink(child) for child in node.items)
    return may_have_kinks(node.text)


def _read_sizes(path: Path) -> list[tuple[int, int]]:
    """States and surfaces of each reading, from their equations."""
    from henon_ref.casefile.case import load_case  # SymPy, which no other outline needs

    systems = [reading.problem.system for reading in load_case(path).readings]
    return [(len(system.states), len(system.surfaces)) for system in systems]


def _contacts(reading: MappingNode) -> int:
    """Surfaces of a scene."""
    connections = child(reading, ("scene", "connections"))
    entries = connections.items if isinstance(connections, SequenceNode) else ()
    kinds = [kind for entry in entries if isinstance(entry, MappingNode) for kind in entry.entries]
    return sum(SURFACES_OF.get(kind, 0) for kind in kinds)
