"""The command: what solvers there are, and whether each can be had here."""

from __future__ import annotations

from dataclasses import dataclass

from henon_ref.commands.exit_status import DONE, command_of
from henon_ref.commands.typer_app import application, examples
from henon_ref.harness.table import Table
from henon_ref.text import message

app = application()
HEADINGS = ("solver", "package", "version", "driven by", "restart", "runs")
HELP = (
    "List solvers: package and version, what drives them, how they restart after an event, and why one cannot be had."
    "\n\n"
    "A solver with a restart takes others, as in heyoka@direction. Those that do not run by default run where a case "
    "or --solvers names them."
)


@dataclass(frozen=True)
class Listed:
    """One solver as the list has it."""

    name: str
    package: str
    version: str
    driven_by: str
    """``tolerances`` or ``step``."""
    restart: str
    """How it restarts its library after an event; empty where there is nothing to restart."""
    runs: str
    """``by default`` or ``when named``."""
    unavailable: str
    """Why it cannot be had; empty where it can."""


@app.command(help=HELP, epilog=examples("solvers"))
def main() -> int:
    """List solvers."""
    found = listed_solvers()
    rows = [(s.name, s.package, s.version, s.driven_by, s.restart, s.runs) for s in found]
    print(Table(HEADINGS, "llllll", rows).text)
    for solver in found:
        if solver.unavailable:
            print(message(f"{solver.name} is unavailable: {solver.unavailable}"))
    return DONE


command = command_of(app, "solvers")


def listed_solvers() -> list[Listed]:
    """Every solver of the registry. A third party's is loaded by a worker first: its module may hang or die."""
    from henon_ref.harness import registry
    from henon_ref.harness.campaign.plugin_probe import fixed_step

    default = registry.default_names()
    return [
        Listed(
            name,
            registry.distribution(name),
            registry.library_version(name) or "not installed",
            "step" if fixed_step(name) else "tolerances",
            registry.restart_of(name),
            "by default" if name in default else "when named",
            _unavailable(name),
        )
        for name in registry.names()
    ]


def _unavailable(name: str) -> str:
    """Why a solver's rows would say that it is unavailable; empty where they would not."""
    from henon_ref.baselines.adapter import LibrarySolver
    from henon_ref.baselines.protocol.program import ProgramSolver
    from henon_ref.errors import UnavailableError
    from henon_ref.harness import registry

    try:
        solver = registry.solver(name)
        if isinstance(solver, LibrarySolver):
            return solver.unavailable()
        if isinstance(solver, ProgramSolver):
            solver.check()
    except UnavailableError as error:
        return str(error)
    return ""
