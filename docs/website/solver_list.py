"""The solvers: package, version, what drives them, how they are restarted."""

from __future__ import annotations

from henon_ref.harness import registry
from henon_ref.harness.table import Table
from henon_ref.text import code


def table() -> str:
    """A row a solver, as markdown."""
    rows = [
        (
            code(name),
            registry.distribution(name) or "",
            "step" if registry.fixed_step(name) else "tolerance",
            registry.restart_of(name) or "",
            "yes" if name in registry.default_names() else "only if named",
        )
        for name in registry.names()
    ]
    return Table(("solver", "package", "driven by", "restart after an event", "run by default"), "lllll", rows).markdown
