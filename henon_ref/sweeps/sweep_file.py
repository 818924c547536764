"""Reading a sweep file into a plan; faults are reported with line and column."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from decimal import Decimal
from functools import partial
from pathlib import Path
from typing import Annotated, Any, TypeVar

from henon_ref.casefile.case import check_model
from henon_ref.casefile.files import read_yaml
from henon_ref.casefile.form import NONE, Form, Scalar, Size, read_form
from henon_ref.casefile.schema import (
    CaseName,
    Expression,
    InitialForm,
    OneLine,
    ResetForm,
    SceneForm,
    SlidingForm,
    SystemForm,
    Text,
    Tolerance,
    whole_number,
)
from henon_ref.errors import ArgumentError
from henon_ref.integrator.integrator import MOST_STEPS
from henon_ref.simulation.system import System
from henon_ref.sweeps.observe import KINDS
from henon_ref.sweeps.plan import RTOL, Plan, RepeatedNameError, check_after, planned
from henon_ref.sweeps.points import Points, check_names, continuation, grid, random, table, values_of
from henon_ref.sweeps.work import Observation
from henon_ref.system.problem import build_problem
from henon_ref.system.source import Path as KeyPath
from henon_ref.system.source import Source
from henon_ref.system.tree import MappingNode, Node, ScalarNode, child, values


def _size(value: Any) -> int:
    if type(value) is not int or value < 1:
        raise ValueError("must be a whole number, 1 or larger")
    return value


Version = Annotated[int, whole_number("must be 1, the version of the sweep file's form", 1)]
Count = Annotated[int, Scalar(_size, {"type": "integer", "minimum": 1})]
One = Annotated[Mapping[str, Any], Size(1, 1)]


class SweepForm(Form):
    """A sweep file, schema 1."""

    schema: Version
    name: CaseName
    title: OneLine
    source: OneLine | None = None
    story: Text | None = None
    system: SystemForm | None = None
    scene: SceneForm | None = None
    sliding: Mapping[str, SlidingForm] = NONE
    resets: Mapping[str, ResetForm] = NONE
    initial: InitialForm
    until: Expression
    points: One
    observe: Annotated[tuple[One, ...], Size(1)]
    rtol: Tolerance = RTOL
    chunk: Count | None = None
    max_steps: Count = MOST_STEPS


T = TypeVar("T")


def load_sweep(path: str | Path) -> Plan:
    """Read a sweep file into a plan; a fault raises CaseError with file, line and column."""
    source = Source(read_yaml(path, "sweep file"), str(path))
    form = read_form(SweepForm, source)
    check_model(source)
    problem = build_problem(source)
    system = System.from_source(source)
    points = _points(source, system, Path(path).parent)
    observations = [_observation(source, system, float(problem.until), k) for k in range(len(form.observe))]
    make = partial(planned, system, rtol=form.rtol, chunk=form.chunk, max_steps=form.max_steps)
    plan = _placed(source, ("points",), lambda: make(grid=points, observe=observations))
    return replace(plan, name=form.name, title=form.title, source=form.source)


def _placed(source: Source, path: KeyPath, make: Callable[[], T], *, key: bool = False) -> T:
    """Return the result of a function; an ArgumentError becomes a CaseError at the path."""
    try:
        return make()
    except RepeatedNameError as error:
        raise source.error(path if error.observation is None else ("observe", error.observation), str(error)) from None
    except ArgumentError as error:
        raise source.error(path, str(error), key=key) from None


def _points(source: Source, system: System, folder: Path) -> Points:
    (kind,) = source.keys(("points",))
    path: KeyPath = ("points", kind)
    known = ("grid", "table", "random", "continuation")
    if kind not in known:
        raise source.unknown(path, f"unknown kind '{kind}'", "allowed", known)
    node = child(source.tree, path)
    if kind == "table":
        if not isinstance(node, ScalarNode) or not isinstance(node.value, str):
            raise source.error(path, "'table' must be the path of a CSV or Parquet file")
        file = folder / node.value
        found = _placed(source, path, lambda: table(file))
        _placed(source, path, lambda: check_names(found.names, system))
        return found
    if not isinstance(node, MappingNode):
        raise source.error(path, f"'{kind}' must be a mapping, as in {{name: value}}")
    if kind == "grid":
        return _placed(source, path, lambda: grid(_axes(source, system, path)))
    if kind == "continuation":
        _known(source, path, ("along", "grid", "directions"))
        given: dict[str, Any] = {"along": _axes(source, system, (*path, "along"))}
        if "grid" in node.entries:
            given["axes"] = _axes(source, system, (*path, "grid"))
        if "directions" in node.entries:
            given["directions"] = _value(source, node.entries["directions"])
        return _placed(source, path, lambda: continuation(**given))
    _known(source, path, ("draws", "count", "seed", "method"))
    _check_keys(source, system, (*path, "draws"))
    return _placed(source, path, lambda: _called(random, _value(source, node)))


def _axes(source: Source, system: System, path: KeyPath) -> dict[str, Any]:
    """Return the axes of a grid, checked one by one, so that an error has the place of its axis, and together."""
    _check_keys(source, system, path)
    found: dict[str, Any] = _value(source, child(source.tree, path))
    for name, given in found.items():
        _placed(source, (*path, name), partial(values_of, {name: given}, str(path[-1])))
    _placed(source, path, partial(values_of, found, str(path[-1])))
    return found


def _check_keys(source: Source, system: System, path: KeyPath) -> None:
    """Raise CaseError if a key of a mapping is neither a parameter nor a state."""
    names = source.keys(path)
    if not names:
        raise source.error(path, f"'{path[-1]}' must be a mapping of parameters and states, as in {{vb: [0.1, 0.2]}}")
    for name in names:
        _placed(source, (*path, name), partial(check_names, [name], system), key=True)


def _known(source: Source, path: KeyPath, allowed: tuple[str, ...]) -> None:
    for name in source.keys(path):
        if name not in allowed:
            message, place = f"unknown key '{name}' in '{path[-1]}'", (*path, name)
            if not allowed:
                raise source.error(place, f"{message}; it has no keys", key=True)
            raise source.unknown(place, message, "allowed", allowed)


def _observation(source: Source, system: System, until: float, k: int) -> Observation:
    (kind,) = source.keys(("observe", k))
    path: KeyPath = ("observe", k, kind)
    if kind not in KINDS:
        raise source.unknown(path, f"unknown observation '{kind}'", "allowed", KINDS)
    node = child(source.tree, path)
    nothing = isinstance(node, ScalarNode) and node.value is None
    if not nothing and not isinstance(node, MappingNode):
        raise source.error(path, f"'{kind}' must be a mapping of its arguments ({{}} if it has none)")
    if not nothing:
        _known(source, path, tuple(inspect.signature(KINDS[kind]).parameters))
    arguments = {} if nothing else _value(source, node)
    made = _placed(source, path, lambda: _called(KINDS[kind], arguments), key=True)
    _placed(source, path, lambda: made.check(system), key=True)
    _placed(source, (*path, "after"), lambda: check_after(made, until))
    return made


def _called(function: Callable[..., T], arguments: Mapping[str, Any]) -> T:
    try:
        inspect.signature(function).bind(**arguments)
    except TypeError as error:  # an argument is missing; unknown ones were refused before
        raise ArgumentError(f"'{function.__name__}': {error}") from None
    return function(**arguments)


def _value(source: Source, node: Node | None) -> Any:
    """Return a node as Python values, with numbers as int and float."""

    def of(scalar: ScalarNode) -> Any:
        if not isinstance(scalar.value, Decimal):
            return scalar.value
        number = float(scalar.value)
        if not math.isfinite(number):
            raise source.error_at(scalar.place, f"{scalar.text} is not a finite number")
        return number

    assert node is not None
    return values(node, of)
