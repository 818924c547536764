"""Case files: the problem, the solvers to run, and the published and exact results to compare with.

A case has one or more readings. ``readings: {name: overrides}`` applies overrides to the top-level keys:
mappings merge key by key, any other value (number, text, list) replaces, and ``null`` removes a key. A reading
with ``system: {field: [...]}`` keeps the states and parameters of the case; a reading with ``scene: null`` and
its own ``system`` has no scene. A file without ``readings`` has one reading, ``default``.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from henon_ref.casefile import expected
from henon_ref.casefile.files import located, parse_yaml, read_yaml
from henon_ref.casefile.form import read_form
from henon_ref.casefile.schema import (
    READING_KEYS,
    CaseForm,
    Exact,
    Expect,
    Gate,
    Orbit,
    Published,
    file_name,
    one_line,
)
from henon_ref.errors import CaseError
from henon_ref.expressions.bounds import exact_sign
from henon_ref.modes.latex import case_html
from henon_ref.modes.problem import Problem
from henon_ref.modes.switched_field import SlidingOverride
from henon_ref.system.assembly import Scene
from henon_ref.system.problem import build_problem, read_scene
from henon_ref.system.source import Path as KeyPath
from henon_ref.system.source import Source
from henon_ref.system.tree import MappingNode, ScalarNode, mapping, merged, words
from henon_ref.text import did_you_mean, listed, message

DEFAULT_READING = "default"
MAX_WRITTEN_OUT = 500_000
"""Largest number of keys and values in all readings together, inherited ones counted in each reading."""


@dataclass(frozen=True)
class Reading:
    """One problem of a case in exact numbers, with the results to compare with."""

    name: str
    title: str
    problem: Problem
    solvers: tuple[str, ...] | None
    """Solvers to run; None: the default ones."""
    tolerances: tuple[float, ...]
    steps: tuple[float, ...]
    """Steps of fixed-step solvers [s]."""
    measure_after: float
    """Sticks that end before this time are not measured [s]."""
    published: Published | None = None
    exact: Exact | None = None
    orbit: Orbit | None = None
    gate: Mapping[str, Gate] = field(default_factory=dict)
    """Solver -> thresholds it must reach."""
    expect: Expect | None = None
    """Expected end of the run; None: status ok at the horizon."""
    source: str | None = None
    story: str | None = None
    equations: str | None = None
    links: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()
    scene: Scene | None = None
    """Bodies and connections of the model; None if the case gives equations."""

    @cached_property
    def mathematics(self) -> dict[str, Any]:
        """Return everything that determines the solution, and nothing else, as values for JSON.

        Titles, tolerances, unused parameters and the order of the file do not matter.
        """
        return _mathematics(self.problem)

    @cached_property
    def mathematics_hash(self) -> str:
        """SHA-256 of :attr:`mathematics` in hexadecimal: the key of a stored truth."""
        text = json.dumps(self.mathematics, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()


@dataclass(frozen=True)
class Case:
    """A case file that has been read and checked."""

    name: str
    title: str
    source: str | None
    readings: tuple[Reading, ...]
    path: Path | None = None

    def __repr__(self) -> str:
        problem = self.readings[0].problem
        where = f" ({self.path})" if self.path else ""
        lines = [
            f"Case {self.name}{where}: {self.title}",
            f"readings: {listed([reading.name for reading in self.readings])}",
            f"states: {listed(problem.system.state_names)}; surfaces: {listed(problem.system.sign_names)}",
        ]
        return "\n".join(map(message, lines))

    def _repr_html_(self) -> str:
        """HTML for a notebook: the readings, and the equations as formulas."""
        return case_html(self.name, self.title, {reading.name: reading.problem for reading in self.readings})

    def reading(self, name: str) -> Reading:
        """Return the reading with the given name.

        Raises
        ------
        CaseError
            If the case has no such reading.
        """
        for reading in self.readings:
            if reading.name == name:
                return reading
        names = [reading.name for reading in self.readings]
        file = str(self.path) if self.path else None
        raise CaseError(f"no reading '{name}'{did_you_mean(name, names)}; readings: {listed(names)}", file=file)


def load_case(
    path: str | Path, *, solvers: Collection[str] | None = None, fixed_step: Callable[[str], bool] | None = None
) -> Case:
    """Read a case file.

    Parameters
    ----------
    path : str or Path
        Path of a case file, or name of a case in the package, such as ``fig8`` or ``hard/grazing``.
    solvers : collection of str, optional
        Known solvers; any other solver name in the file raises an error. None: names are not checked.
    fixed_step : callable, optional
        Returns True if the solver of a given name has a step instead of a tolerance; a gate cannot then ask for
        its row at a tolerance. None: not checked.

    Raises
    ------
    CaseError
        With file, line and column, the fault and the allowed values.
    """
    return case_and_sources(path, solvers, fixed_step)[0]


def case_and_sources(
    path: str | Path, solvers: Collection[str] | None = None, fixed_step: Callable[[str], bool] | None = None
) -> tuple[Case, dict[str, Source]]:
    """Read a case file and return the case together with the source of every reading (see :func:`load_case`)."""
    if not isinstance(path, str | Path):
        raise CaseError(f"path is {path!r}, wanted a str or a Path")
    path = located(path)
    case, sources = _case(Source(read_yaml(path), str(path)), solvers, fixed_step)
    return replace(case, path=path), sources


def parse_case(
    text: str,
    *,
    file: str | None = None,
    solvers: Collection[str] | None = None,
    fixed_step: Callable[[str], bool] | None = None,
) -> Case:
    """Read a case from text (see :func:`load_case`)."""
    if not isinstance(text, str):
        raise CaseError(f"text is {text!r:.60}, wanted a str")
    return _case(Source(parse_yaml(text, file=file), file), solvers, fixed_step)[0]


def _case(
    whole: Source, solvers: Collection[str] | None, fixed_step: Callable[[str], bool] | None
) -> tuple[Case, dict[str, Source]]:
    sources = reading_sources(whole)
    readings = tuple(_reading(name, source, solvers, fixed_step) for name, source in sources.items())
    name, title, source = (_line(whole, key) for key in ("name", "title", "source"))
    if title is None:
        raise whole.error((), "the key 'title' is missing at the top (a reading may have a title in addition)")
    assert name is not None  # every reading has the name and none may change it
    return Case(name, title, source, readings), sources


def _line(whole: Source, key: str) -> str | None:
    """Return a top-level text of the file in one line; None if it is absent."""
    node = whole.tree.entries.get(key)
    if node is None or (isinstance(node, ScalarNode) and node.value is None):
        return None
    return _checked(whole, (key,), one_line, node.value if isinstance(node, ScalarNode) else node)


def _checked(whole: Source, path: KeyPath, check: Callable[[object], str], value: object, *, key: bool = False) -> str:
    try:
        return check(value)
    except ValueError as error:
        raise whole.error(path, f"'{path[0]}': {error}", key=key) from None


def reading_sources(whole: Source) -> dict[str, Source]:
    """Return the source of every reading of a file by name, with its overrides applied."""
    tree, file = whole.tree, whole.file
    if "readings" not in tree.entries:
        return {DEFAULT_READING: whole}
    readings = tree.entries["readings"]
    if not isinstance(readings, MappingNode) or not readings.entries:
        message = "'readings' must be a mapping, as in {name: {key: value}}, with at least one reading"
        raise whole.error(("readings",), message)
    base = mapping({k: v for k, v in tree.entries.items() if k != "readings"}, tree.place, tree.keys)
    found, size = dict[str, Source](), 0
    for name, overrides in readings.entries.items():
        path = ("readings", name)
        _checked(whole, path, file_name, name, key=True)
        if not isinstance(overrides, MappingNode):
            message = f"the reading '{name}' must be a mapping of the keys that it changes ({{}} if it changes none)"
            raise whole.error(path, message)
        for key in overrides.entries:
            if key not in READING_KEYS:
                message = f"a reading cannot change the key '{key}'"
                raise whole.unknown((*path, key), message, "allowed", sorted(READING_KEYS))
        source = Source(merged(base, overrides), file, f" [reading '{name}']", whole.work)
        size += source.tree.size
        if size > MAX_WRITTEN_OUT:
            message = f"with this reading, all readings together have more than {MAX_WRITTEN_OUT} keys and values"
            raise whole.error(path, f"{message} (inherited ones included); give fewer readings", key=True)
        check_added_parameters(source, whole)
        found[name] = source
    return found


def _reading(
    name: str, source: Source, solvers: Collection[str] | None, fixed_step: Callable[[str], bool] | None
) -> Reading:
    form = read_form(CaseForm, source)
    check_model(source)
    expected.check_runs(source, form, solvers)
    expected.check_gates(source, form, fixed_step)
    problem = build_problem(source)
    _check_surfaces(source, problem)
    values = problem.system.parameter_values
    after = source.number(("measure", "after"), values) if "after" in source.keys(("measure",)) else 0
    if after != 0 and exact_sign(problem.until - after) <= 0:
        raise source.error(("measure", "after"), f"'after' must be earlier than 'until', {problem.until}")
    return Reading(
        name=name,
        title=form.title,
        problem=problem,
        solvers=form.solvers,
        tolerances=form.tolerances,
        steps=form.steps,
        measure_after=float(after),
        published=form.published,
        exact=expected.exact(source, form, problem),
        orbit=expected.orbit(source, form, problem),
        gate=dict(form.gate),
        expect=expected.expectation(source, form, problem),
        source=form.source,
        story=form.story,
        equations=form.equations,
        links=form.links,
        tags=form.tags,
        scene=read_scene(source) if form.scene is not None else None,
    )


def _check_surfaces(source: Source, problem: Problem) -> None:
    """Raise CaseError if a case has no surface."""
    if problem.system.surfaces:
        return
    if source.has_scene:
        message = "the scene has no surface, so there is no transition to find; add a friction or a stop"
        raise source.error(("scene", "connections"), message, key=True)
    message = "there is no transition to find: 'surfaces' is empty and 'field' has no kinks; add a surface"
    raise source.error(("system",), message, key=True)


def check_added_parameters(source: Source, whole: Source) -> None:
    """Raise CaseError if a reading adds a parameter that nothing in the file uses, as a misspelt name does."""
    for path in (("system", "parameters"), ("scene", "parameters")):
        known = whole.keys(path)
        added = [name for name in source.keys(path) if name not in known]
        for name in sorted({*added} - words(whole.tree)) if added else ():
            unused = f"no expression uses the parameter '{name}'"
            raise source.unknown((*path, name), unused, "parameters", known or ["none"])


def check_model(source: Source) -> None:
    """Raise CaseError if a file has two models or none."""
    message = "give the model once: either 'system' or 'scene'"
    given = [key for key in ("system", "scene") if isinstance(source.tree.entries.get(key), MappingNode)]
    if not given:
        raise source.error((), message)
    if len(given) == 2:
        second = max(given, key=lambda key: (source.tree.keys[key].line, source.tree.keys[key].column))
        raise source.error((second,), message, key=True)


def _mathematics(problem: Problem) -> dict[str, Any]:
    """Return the mathematics of a problem; absent and default keys are omitted, so that stored hashes stay valid."""
    system, names = problem.system, problem.system.sign_names
    text = cache(str)  # the contacts of a chain have nearly all equations of their sliding in common
    used = set().union(*(e.free_symbols for e in system.expressions))
    found = {
        "states": list(system.state_names),
        "surfaces": [[name, text(h)] for name, h in zip(names, system.surfaces, strict=True)],
        "field": [text(f) for f in system.field],
        "valid": [str(v) for v in system.valid],
        "parameters": {p.name: str(v) for p, v in sorted(system.parameters.items(), key=str) if p in used},
        "sliding": {names[i]: _override_text(o, text) for i, o in sorted(system.overrides.items())},
        "start": str(problem.start),
        "initial": [str(x) for x in problem.initial],
        "until": str(problem.until),
        "mode": {names[i]: s for i, s in sorted(problem.initial_mode.items())},
    }
    if system.resets:
        resets = sorted(system.resets.items())
        found["resets"] = {names[i]: {x.name: str(value) for x, value in r.map.items()} for i, r in resets}
        priorities = {names[i]: r.priority for i, r in resets if r.priority}
        if priorities:
            found["priorities"] = priorities
    return found


def _override_text(override: SlidingOverride, text: Callable[[Any], str]) -> dict[str, Any]:
    found: dict[str, Any] = {
        "field": [text(f) for f in override.field],
        "release": [[text(r.when), r.direction, r.to] for r in override.release],
    }
    if override.entry != "attracting":
        found["entry"] = override.entry
    return found
