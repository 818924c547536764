"""The program ``henon-ref`` (also ``python -m henon_ref``) and its table of subcommands.

The module of a subcommand is imported only when the subcommand runs, so that each subcommand starts fast.
"""

from __future__ import annotations

import platform
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Annotated, Any

import typer

from henon_ref.commands import FLAG, examples, sweep
from henon_ref.commands.exit_status import exit_status, parsed

sweep_app = sweep.app


@dataclass(frozen=True)
class Subcommand:
    """Location and summary of a subcommand."""

    target: str
    """``module:function`` of the function that takes the arguments and returns the exit status. A module without a dot
    is in :mod:`henon_ref.harness.cli`, any other in :mod:`henon_ref`."""
    summary: str

    def run(self, arguments: Sequence[str]) -> int:
        """Import and run the subcommand; return the exit status."""
        return int(self._found("")(arguments))

    @property
    def app(self) -> typer.Typer:
        """Typer application of the subcommand, in the same module."""
        found: typer.Typer = self._found("app")
        return found

    def _found(self, instead: str) -> Any:
        """Import the function of the subcommand, or the object named like it with ``instead`` as last word."""
        name, _, function = self.target.partition(":")
        module = import_module(f"henon_ref.{name}" if "." in name else f"henon_ref.harness.cli.{name}")
        return getattr(module, re.sub("(command|program)$", instead, function) if instead else function)


SUBCOMMANDS = {
    "compare": Subcommand("compare:program", "Run solvers on cases, score them against the truth, and write reports."),
    "explain": Subcommand("explain_cases:command", "Explain case files without a run."),
    "gate": Subcommand("gate:command", "Check reports against their cases' gates, and against an earlier comparison."),
    "check": Subcommand("stored:check_command", "Check stored reports against a fresh comparison."),
    "demo": Subcommand("commands.simulate:demo_command", "Draw a stick-slip orbit with its transitions."),
    "simulate": Subcommand("commands.simulate:command", "Simulate one case; print its transitions, and draw the run."),
    "sweep": Subcommand("main:sweep_program", "Run one system at many points, and observe each run."),
    "cases": Subcommand("lists:cases_command", "List cases: names, sizes, titles, and tags."),
    "solvers": Subcommand("lists:solvers_command", "List solvers: versions, properties, and why one is unavailable."),
    "schema": Subcommand("lists:schema_command", "Print the JSON Schema of a case file."),
    "new-solver": Subcommand("new_solver:command", "Write a template package for a solver of your own."),
    "truth": Subcommand("stored:truth_command", "Compute truths, compare them with the stored ones, and store them."),
    "study": Subcommand("study:command", "Run a study: price, paired-times, atlas, restarts, causes or paper."),
}
"""Name -> subcommand, in the order of the help."""


def program(arguments: Sequence[str] | None = None) -> int:
    """Run the program with arguments, by default those of the process, and return the exit status."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    words = words[1:] if words[:1] == ["--"] else words
    if words and words[0] in SUBCOMMANDS:
        return SUBCOMMANDS[words[0]].run(words[1:])
    return exit_status(lambda: int(parsed(application(), words or ["--help"])), name="main", arguments=words)


def sweep_program(arguments: Sequence[str] | None = None) -> int:
    """Run the command ``sweep``, which then also locks the folder of the results and writes the page of the folder."""
    from henon_ref.harness.report.sweep import written

    return sweep.program(arguments, around=written)


def application() -> typer.Typer:
    """Make the typer application of the program's own options; subcommands parse their arguments themselves."""
    app = typer.Typer(
        add_completion=False,
        pretty_exceptions_enable=False,
        invoke_without_command=True,
        callback=_own_options,
        epilog=examples("demo", "cases", "compare fig8", "explain my_case.yaml", "compare --help"),
    )
    for name, subcommand in SUBCOMMANDS.items():
        app.command(name, help=subcommand.summary)(lambda: None)
    return app


def _own_options(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.", metavar=FLAG)] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="With --version: print also the versions of the libraries.", metavar=FLAG)
    ] = False,
) -> None:
    """Find out which solvers compute the stick-slip transitions of a Filippov system correctly, and at what cost."""
    if version:
        _print_versions(libraries=verbose)
        raise typer.Exit
    if verbose:
        raise typer.BadParameter("it requires --version", param_hint="--verbose")
    if context.invoked_subcommand is None:
        raise typer.BadParameter(f"no subcommand; the subcommands are {', '.join(SUBCOMMANDS)}")


def _print_versions(*, libraries: bool) -> None:
    from henon_ref import __version__

    print(f"henon-ref {__version__}")
    if libraries:
        from henon_ref.harness.registry import all_versions

        print(f"python {platform.python_version()}")
        for name, version in all_versions().items():
            if name != "henon-ref":
                print(f"{name} {version or 'is not installed'}")
