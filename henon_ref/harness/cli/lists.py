"""Commands ``cases``, ``solvers`` and ``schema``: list cases and solvers, and print the JSON Schema of a case file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from henon_ref.casefile.files import located, read_yaml, shipped_folder, yaml_files
from henon_ref.commands import application, examples
from henon_ref.commands.exit_status import DONE, command_of
from henon_ref.errors import CaseError, UnavailableError
from henon_ref.expressions.grammar import NOT_STATES, may_have_kinks
from henon_ref.harness.table import Table
from henon_ref.system.tree import MappingNode, Node, ScalarNode, SequenceNode, child, merged
from henon_ref.text import did_you_mean, listed, message

cases_app, solvers_app, schema_app = application(), application(), application()


@cases_app.command(epilog=examples("cases", "cases --tag grazing", "cases hard my_cases"))
def cases(
    folders: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Case files, or folders of them. If omitted: the cases that come with the program.",
            show_default=False,
            metavar="CASE",
        ),
    ] = None,
    tag: Annotated[
        list[str] | None,
        typer.Option(help="List only cases with this tag; if repeated, cases with all these tags.", metavar="TAG"),
    ] = None,
) -> int:
    """List cases: names, numbers of readings, states and surfaces, titles, and tags."""
    # The files are read as YAML only; their expressions are not parsed.
    places = [located(path) for path in folders or [shipped_folder()]]
    files = [file for place in places for file in (yaml_files(place) if place.is_dir() else [place])]
    found = [outline(file) for file in files]
    tags = dict.fromkeys(own for case in found for own in case.tags)
    for wanted in tag or ():
        if wanted not in tags:
            raise CaseError(f"no case has the tag '{wanted}'{did_you_mean(wanted, tags)}; tags: {listed(tags, 60)}")
    lines = [
        (own.name, str(own.readings), _span(own.states), _span(own.surfaces), own.title, ", ".join(own.tags))
        for own in found
        if set(tag or ()) <= set(own.tags)
    ]
    print(Table(("name", "readings", "states", "surfaces", "title", "tags"), "lrrrll", lines).text)
    return DONE


def _span(sizes: Sequence[int]) -> str:
    """Format the number of one reading, or the range of several."""
    least, largest = min(sizes), max(sizes)
    return str(least) if least == largest else f"{least} to {largest}"


class Outline(NamedTuple):
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
        contacts = sum(kind in ("friction", "stop") for kind in kinds)
        return sum(key not in NOT_STATES for key in initial.entries), contacts
    raise CaseError("the case has no model: give 'system' or 'scene', and 'initial'", file=str(path))


def _may_hold_kink(node: Node) -> bool:
    """Check whether an expression of a model may have a kink or a jump."""
    if isinstance(node, MappingNode):
        return "normal" in node.entries or any(map(_may_hold_kink, node.entries.values()))
    return any(map(_may_hold_kink, node.items)) if isinstance(node, SequenceNode) else may_have_kinks(node.text)


@solvers_app.command(
    help="List solvers: package, version, error control (tolerances or fixed step), restart after events, and the "
    "reason why a solver is unavailable.\n\n"
    "A solver with a restart can be given another one: heyoka@direction. A solver that does not run by default runs if "
    "a case or --solvers names it.",
    epilog=examples("solvers"),
)
def solvers() -> int:
    # A worker loads each third-party solver first, since its module may hang or crash.
    from henon_ref.harness import registry
    from henon_ref.harness.campaign.options import fixed_step

    default = registry.default_names()
    rows = [
        (
            name,
            registry.distribution(name),
            registry.library_version(name) or "not installed",
            "step" if fixed_step(name) else "tolerances",
            registry.restart_of(name),
            "by default" if name in default else "when named",
        )
        for name in registry.names()
    ]
    print(Table(("solver", "package", "version", "driven by", "restart", "runs"), "llllll", rows).text)
    for name, *_ in rows:
        if why := unavailable(name):
            print(message(f"{name} is unavailable: {why}"))
    return DONE


def unavailable(name: str) -> str:
    """Return the reason why a solver is unavailable; empty if it is available."""
    from henon_ref.baselines.adapter import LibrarySolver
    from henon_ref.baselines.protocol.program import ProgramSolver
    from henon_ref.harness import registry

    try:
        solver = registry.solver(name)
        if isinstance(solver, LibrarySolver | ProgramSolver):
            solver.check()
    except UnavailableError as error:
        return str(error)
    return ""


@schema_app.command(
    help="Print the JSON Schema of a case file, for editors that complete and check YAML.\n\n"
    "Save the schema as case.schema.json next to a case file, and begin the case file with the line "
    "'# yaml-language-server: $schema=case.schema.json': the editor then checks it while you write.",
    epilog=examples("schema > case.schema.json"),
)
def schema() -> int:
    from henon_ref.casefile.json_schema import schema_text

    print(schema_text(), end="")
    return DONE


cases_command = command_of(cases_app, "cases")
solvers_command = command_of(solvers_app, "solvers")
schema_command = command_of(schema_app, "schema")
