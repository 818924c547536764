"""The command reference, read off the commands themselves."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import typer

from henon_ref.harness.cli.main import SUBCOMMANDS, application
from henon_ref.harness.table import Table
from henon_ref.text import code

_OPTION = re.compile(r"(?<!\S)--[a-z-]+( [a-z]+@[a-z]+)?")
"""An option that a text names, with a value such as ``heyoka@direction``."""
OPTIONS = "Options"
"""Panel of options that name none."""


def page() -> str:
    """A section a command: usage, arguments, options, examples."""
    sections = [_section("henon-ref", typer.main.get_command(application()), examples=True)]
    for name, subcommand in SUBCOMMANDS.items():
        sections.append(_section(f"henon-ref {name}", typer.main.get_command(subcommand.app), examples=True))
    return "\n\n".join(sections)


def _section(name: str, command: Any, *, examples: bool) -> str:
    parts = [f"## {code(name)}", _sentence(command.help), f"```text\n{_usage(name, command)}\n```"]
    if hasattr(command, "commands"):
        rows = [(f"[{code(key)}](#henon-ref-{key})", own.help) for key, own in command.commands.items()]
        parts.append(Table(("subcommand", ""), "ll", rows).markdown)
    parts += _options(command)
    if examples and command.epilog:
        lines = [line for line in command.epilog.splitlines() if line.startswith("henon-ref ")]
        parts.append("```text\n" + "\n".join(lines) + "\n```")
    return "\n\n".join(parts)


def _usage(name: str, command: Any) -> str:
    arguments = [parameter for parameter in command.params if parameter.param_type_name == "argument"]
    words = [f"{own.metavar or own.name.upper()}{'...' if own.nargs == -1 else ''}" for own in arguments]
    if hasattr(command, "commands"):
        words.append("SUBCOMMAND ...")
    return " ".join([name, "[OPTIONS]", *words])


def _options(command: Any) -> Iterator[str]:
    panels: dict[str, list[tuple[str, ...]]] = {}
    for parameter in command.params:
        if parameter.param_type_name == "argument":
            words = code(parameter.metavar or parameter.name.upper())
        else:
            names = ", ".join([*parameter.opts, *parameter.secondary_opts])
            words = code(f"{names} {parameter.metavar}".strip() if parameter.metavar else names)
        panel = getattr(parameter, "rich_help_panel", None) or OPTIONS
        panels.setdefault(panel, []).append((words, f"{_sentence(parameter.help)}{_default(parameter)}"))
    for panel, rows in panels.items():
        yield Table((panel.lower(), "meaning"), "ll", rows).markdown


def _default(parameter: Any) -> str:
    """What holds where an option is left out, unless its text says so or it is a switch."""
    if parameter.required or parameter.default is None or isinstance(parameter.default, bool):
        return ""
    return f" Default: {code(str(parameter.default))}."


def _sentence(text: str | None) -> str:
    return _OPTION.sub(lambda found: code(found[0]), " ".join((text or "").split()))
