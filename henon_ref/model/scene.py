"""Scenes: a mechanical body and the effects that act on it, written out as a Filippov system."""

from __future__ import annotations

from henon_ref.model.source import Names, Source
from henon_ref.model.system import FilippovSystem


def build_scene(source: Source) -> tuple[FilippovSystem, Names]:
    """The system of a scene."""
    raise source.error(("scene",), "scenes are not built yet; write the equations under 'system'", key=True)
