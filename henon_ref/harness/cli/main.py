"""The program ``henon-ref``, which is also ``python -m henon_ref``: one subcommand a job.

A subcommand's module is imported when it is called, so that the others' libraries cost it nothing.
"""

from __future__ import annotations

import platform
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Annotated

import typer

from henon_ref.commands.exit_status import DONE, exit_status, parsed
from henon_ref.commands.typer_app import FLAG, examples


@dataclass(frozen=True)
class Subcommand:
    """Where a subcommand is found, and what the list of them says of it."""

    target: str
    """``module:function``, in :mod:`henon_ref.harness.cli` unless it says more: it takes the arguments, and returns the
    status."""
    summary: str

    @property
    def module(self) -> str:
        """The module's whole name."""
        name = self.target.partition(":")[0]
        return f"henon_ref.{name}" if "." in name else f"henon_ref.harness.cli.{name}"

    def run(self, arguments: Sequence[str]) -> int:
        """Import it, and run it; the exit status."""
        return int(getattr(import_module(self.module), self.target.partition(":")[2])(arguments))


SUBCOMMANDS = {
    "compare": Subcommand("compare:program", "Run every solver on cases, score it against the truth, write a report."),
    "explain": Subcommand("explain_cases:command", "Explain what case files say, without a run."),
    "gate": Subcommand("gate:command", "Check reports against their cases' gates, and against an earlier comparison."),
    "check": Subcommand("check:command", "Check stored reports against a fresh comparison."),
    "demo": Subcommand("commands.demo:command", "Draw a stick-slip orbit with its transitions."),
    "simulate": Subcommand("commands.simulate:command", "Simulate one case: its transitions, a picture."),
    "sweep": Subcommand("sweep:program", "Run one system at many points, and observe each run."),
    "cases": Subcommand("cases:command", "List cases: names, sizes, titles, tags."),
    "solvers": Subcommand("solvers:command", "List solvers: versions, options, and why one cannot be had."),
    "schema": Subcommand("schema:command", "Print the JSON Schema of a case file."),
    "new-solver": Subcommand("new_solver:command", "Write a package with a solver of your own to fill in."),
    "truth": Subcommand("truth:command", "Compute truths, compare them with the stored ones, store them."),
    "study": Subcommand("study:command", "Run a study: price, paired-times, atlas, restarts, causes or paper."),
}
"""Name -> subcommand, in the order of the list."""

EXAMPLES = ("demo", "cases", "compare fig8", "explain my_case.yaml", "compare --help")


@dataclass(frozen=True)
class Chosen:
    """A subcommand and what it is given."""

    subcommand: Subcommand
    arguments: list[str]


def program(arguments: Sequence[str] | None = None) -> int:
    """Run the program; the exit status.

    Parameters
    ----------
    arguments : sequence of str, optional
        None: those of the process.
    """
    words = sys.argv[1:] if arguments is None else list(arguments)
    chosen: list[Chosen] = []
    status = exit_status(lambda: _choose(words, chosen), name="main", arguments=words)
    return chosen[0].subcommand.run(chosen[0].arguments) if chosen else status


def _choose(words: Sequence[str], chosen: list[Chosen]) -> int:
    """Read the words before a subcommand's own: it says itself how it ends, outside of this one's reading."""
    found = parsed(application(words), list(words) or ["--help"])
    if isinstance(found, Chosen):
        chosen.append(found)
        return DONE
    return int(found)


def application(words: Sequence[str]) -> typer.Typer:
    """The program's own options and its list of subcommands, whose arguments are passed on as they are."""
    app = typer.Typer(
        add_completion=False,
        pretty_exceptions_enable=False,
        invoke_without_command=True,
        callback=_own_options,
        epilog=examples(*EXAMPLES),
    )
    passed_on = {"ignore_unknown_options": True, "allow_extra_args": True, "help_option_names": []}
    for name, subcommand in SUBCOMMANDS.items():
        own = Chosen(subcommand, list(words[words.index(name) + 1 :]) if name in words else [])
        app.command(name, help=subcommand.summary, context_settings=passed_on)(_chooser(own))
    return app


def _chooser(chosen: Chosen) -> Callable[[typer.Context], Chosen]:
    def choose(context: typer.Context) -> Chosen:
        return chosen

    choose.__annotations__["context"] = typer.Context  # which typer cannot look up here
    return choose


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
