"""The program ``henon-ref``, which is also ``python -m henon_ref``: one subcommand a job.

A subcommand's module is imported when it is called, so that the others' libraries cost it nothing.
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

from henon_ref.commands.exit_status import exit_status, parsed
from henon_ref.commands.typer_app import FLAG, examples


@dataclass(frozen=True)
class Subcommand:
    """Where a subcommand is found, and what the list of them says of it."""

    target: str
    """``module:function``, in :mod:`henon_ref.harness.cli` unless it says more: it takes the arguments, and returns the
    status."""
    summary: str

    def run(self, arguments: Sequence[str]) -> int:
        """Import it, and run it; the exit status."""
        return int(self._found("")(arguments))

    @property
    def app(self) -> typer.Typer:
        """Its typer application: beside the function, and named like it."""
        found: typer.Typer = self._found("app")
        return found

    def _found(self, instead: str) -> Any:
        """The function; what is named like it, ``instead`` in place of its last word."""
        name, _, function = self.target.partition(":")
        module = import_module(f"henon_ref.{name}" if "." in name else f"henon_ref.harness.cli.{name}")
        return getattr(module, re.sub("(command|program)$", instead, function) if instead else function)


SUBCOMMANDS = {
    "compare": Subcommand("compare:program", "Run every solver on cases, score it against the truth, write a report."),
    "explain": Subcommand("explain_cases:command", "Explain what case files say, without a run."),
    "gate": Subcommand("gate:command", "Check reports against their cases' gates, and against an earlier comparison."),
    "check": Subcommand("check:command", "Check stored reports against a fresh comparison."),
    "demo": Subcommand("commands.demo:command", "Draw a stick-slip orbit with its transitions."),
    "simulate": Subcommand("commands.simulate:command", "Simulate one case: its transitions, a picture."),
    "sweep": Subcommand("sweep:program", "Run one system at many points, and observe each run."),
    "cases": Subcommand("lists:cases_command", "List cases: names, sizes, titles, tags."),
    "solvers": Subcommand("lists:solvers_command", "List solvers: versions, options, and why one cannot be had."),
    "schema": Subcommand("lists:schema_command", "Print the JSON Schema of a case file."),
    "new-solver": Subcommand("new_solver:command", "Write a package with a solver of your own to fill in."),
    "truth": Subcommand("truth:command", "Compute truths, compare them with the stored ones, store them."),
    "study": Subcommand("study:command", "Run a study: price, paired-times, atlas, restarts, causes or paper."),
}
"""Name -> subcommand, in the order of the list."""

EXAMPLES = ("demo", "cases", "compare fig8", "explain my_case.yaml", "compare --help")


def program(arguments: Sequence[str] | None = None) -> int:
    """Run the program, with the process's arguments if none are given; the exit status."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    words = words[1:] if words[:1] == ["--"] else words
    if words and words[0] in SUBCOMMANDS:
        return SUBCOMMANDS[words[0]].run(words[1:])
    return exit_status(lambda: int(parsed(application(), words or ["--help"])), name="main", arguments=words)


def application() -> typer.Typer:
    """The program's own options and its list of subcommands, which read their arguments themselves."""
    app = typer.Typer(
        add_completion=False,
        pretty_exceptions_enable=False,
        invoke_without_command=True,
        callback=_own_options,
        epilog=examples(*EXAMPLES),
    )
    for name, subcommand in SUBCOMMANDS.items():
        app.command(name, help=subcommand.summary)(lambda: None)
    return app


def _own_options(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.", metavar=FLAG)] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="With --version: the libraries' versions, too.", metavar=FLAG)
    ] = False,
) -> None:
    """Which solver gets the stick-slip transitions of a Filippov system right, to how many digits, at what cost."""
    if version:
        _print_versions(libraries=verbose)
        raise typer.Exit
    if verbose:
        raise typer.BadParameter("it goes with --version", param_hint="--verbose")
    if context.invoked_subcommand is None:
        raise typer.BadParameter(f"no subcommand; there are {', '.join(SUBCOMMANDS)}")


def _print_versions(*, libraries: bool) -> None:
    from henon_ref import __version__

    print(f"henon-ref {__version__}")
    if libraries:
        from henon_ref.harness.registry import all_versions

        print(f"python {platform.python_version()}")
        for name, version in all_versions().items():
            if name != "henon-ref":
                print(f"{name} {version or 'is not installed'}")
