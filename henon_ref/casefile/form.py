"""Reading a mapping of a file into the class that describes it; each fault is reported with its line and column.

The annotations of a :class:`Form` describe its keys: a scalar (``Annotated`` with a :class:`Scalar`), one of several
words (``Literal``), a list (``tuple``), a mapping from names (``Mapping``), another form, or any value (``Any``).
``Annotated`` may add the number of entries (:class:`Size`) and the meaning of the key (text).
:mod:`henon_ref.casefile.schema` has the forms of a case file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, replace
from functools import cache
from types import MappingProxyType, NoneType
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from henon_ref.expressions.grammar import MAX_STATES
from henon_ref.system.source import Source
from henon_ref.system.tree import MappingNode, Node, Place, ScalarNode, SequenceNode, to_python
from henon_ref.text import did_you_mean, listed, shortened

AnyForm = TypeVar("AnyForm", bound="Form")
NONE: Mapping[str, Any] = MappingProxyType({})
"""Default of a mapping that may be omitted."""


class Form:
    """Base class of the mappings of a file; the annotated names are the keys, keys with a default may be omitted."""

    OTHERS: Any = None
    """Annotation of the values of all other keys; None if no other keys are allowed."""
    BESIDE: tuple[str, ...] = ()
    """Keys that are read elsewhere."""
    HINTS = NONE
    """Unknown key -> hint appended to its error message."""

    def __init__(self, **values: Any) -> None:
        vars(self).update(values)

    @classmethod
    @cache
    def keys(cls) -> dict[str, Kind]:
        hints = get_type_hints(cls, include_extras=True)
        own = (name for name in hints if name not in Form.__annotations__)
        return {name: replace(kind_of(hints[name]), default=getattr(cls, name, MISSING)) for name in own}


@dataclass(frozen=True, eq=False)
class Scalar:
    read: Callable[[Any], Any]
    """Converts a value of the file; raises ValueError with the fault."""
    schema: Mapping[str, Any]


@dataclass(frozen=True)
class Size:
    """Allowed number of entries of a list or a mapping."""

    least: int = 0
    most: int | None = None
    """``MAX_STATES`` means the limit of the source (larger for models from Python)."""


@dataclass(frozen=True)
class Kind:
    """Kind of the value of a key or of an entry."""

    type: Any
    """A :class:`Scalar`, the words of a ``Literal``, ``tuple``, ``Mapping``, a form, or ``Any``."""
    inner: tuple[Any, ...] = ()
    """Annotations of the entries of a list, or of the names and entries of a mapping."""
    size: Size = Size()
    optional: bool = False
    """Whether the value may be null."""
    description: str = ""
    default: Any = None
    """Value if the key is omitted; ``MISSING`` if it is required."""

    @property
    def is_form(self) -> bool:
        """Whether the value is a mapping with fixed keys."""
        return isinstance(self.type, type) and issubclass(self.type, Form)


@cache
def kind_of(annotation: Any) -> Kind:
    inner = get_args(annotation)
    if get_origin(annotation) is Annotated:
        fields = {Scalar: "type", Size: "size", str: "description"}  # by the type of the note
        return replace(kind_of(inner[0]), **{fields[type(note)]: note for note in inner[1:]})
    if NoneType in inner:
        return replace(kind_of(inner[0]), optional=True)
    if get_origin(annotation) is Literal:
        return Kind(inner)
    return Kind(get_origin(annotation) or annotation, inner)


def read_form(form: type[AnyForm], source: Source, *, partial: bool = False) -> AnyForm:
    """Read a mapping of a file into a form; CaseError with line and column of the first key or value with a fault.

    ``partial``: whether required keys at the top level may be missing.
    """
    reader = _Reader(source.most_states)
    found: AnyForm = reader.form(form, source.tree, "", source.tree.place, partial=partial)
    if reader.faults:
        # A misspelt key is both unknown and missing; the unknown key is reported.
        _, place, message = min(reader.faults, key=lambda fault: (fault[0], fault[1].line, fault[1].column))
        raise source.error_at(place, message)
    return found


class _Reader:
    """Reader of values; collects the faults: whether a key is missing, the place, and the message."""

    def __init__(self, most_states: int) -> None:
        self.most_states = most_states
        self.faults: list[tuple[bool, Place, str]] = []

    def form(self, form: type[Form], node: MappingNode, name: str, place: Place, *, partial: bool = False) -> Any:
        """Read a form under a key (at ``place``), or in a list (no name)."""
        keys, where = form.keys(), f" in '{name}'" if name else ""
        values = {}
        for own, entry in node.entries.items():
            if own in keys:
                values[own] = self.value(keys[own], entry, own, name, node.keys[own])
            elif form.OTHERS is not None:
                self.value(kind_of(form.OTHERS), entry, own, name, node.keys[own])
            else:
                known = [*keys, *form.BESIDE]
                message = f"unknown key '{own}'{where}{did_you_mean(own, known)}; allowed: {listed(known)}"
                message += form.HINTS.get(own, "")
                self.faults.append((False, node.keys[own], message))
        needed = [] if partial else [own for own, kind in keys.items() if kind.default is MISSING]
        missing = [own for own in needed if own not in node.entries]
        self.faults += [(True, place, f"the key '{own}' is missing{where}") for own in missing]
        return None if self.faults else form(**values)

    def value(self, kind: Kind, node: Node, name: str, within: str, place: Place) -> Any:
        """Read the value of a key (at ``place``), or an entry of a list (no name); None if it has a fault."""
        if kind.optional and isinstance(node, ScalarNode) and node.value is None:
            return None
        if kind.type is Any:
            return node
        try:
            if isinstance(kind.type, Scalar):
                return kind.type.read(to_python(node))
            self._check(kind, node)
        except ValueError as error:
            what, where = f"'{name}'" if name else "an entry", f" in '{within}'" if within else ""
            return self.faults.append((False, node.place, f"{what}{where}: {error}"))
        if kind.is_form and isinstance(node, MappingNode):
            return self.form(kind.type, node, name, place)
        if isinstance(node, SequenceNode):
            of = kind_of(kind.inner[0])
            return tuple(self.value(of, item, "", name, item.place) for item in node.items)
        if isinstance(node, MappingNode):
            names, of = map(kind_of, kind.inner)
            for own, entry in node.entries.items():
                if isinstance(names.type, Scalar):
                    self.value(names, ScalarNode(entry.place, own, own, None), own, name, place)
            return {own: self.value(of, entry, own, name, node.keys[own]) for own, entry in node.entries.items()}
        return node.value

    def _check(self, kind: Kind, node: Node) -> None:
        """Raise ValueError if a word, list or mapping is not one, or has too few or too many entries."""
        if isinstance(kind.type, tuple):
            if not isinstance(node, ScalarNode) or node.value not in kind.type:
                words = [*map(repr, kind.type)]
                listed_words = " or ".join([", ".join(words[:-1]), words[-1]] if words[1:] else words)
                raise ValueError(f"must be {listed_words}{_given(node)}")
            return
        wanted = SequenceNode if kind.type is tuple else MappingNode
        if not isinstance(node, wanted):
            example = f"{{{'key' if kind.is_form else 'name'}: value}}"
            what = "a list, as in [1, 2]" if kind.type is tuple else f"a mapping, as in {example}"
            raise ValueError(f"must be {what}{_given(node)}")
        count = len(node.items if isinstance(node, SequenceNode) else node.entries)
        most = self.most_states if kind.size.most == MAX_STATES else kind.size.most
        if count < kind.size.least:
            raise ValueError("must have at least one entry")
        if most is not None and count > most:
            raise ValueError(f"may have at most {most} entries")


def _given(node: Node) -> str:
    """End of a message: the value that the file has instead."""
    if isinstance(node, ScalarNode):
        shown = f"the text {shortened(node.text)}" if isinstance(node.value, str) else node.text
        return f"; here it is {shown or 'empty'}"
    return "; here it is a mapping" if isinstance(node, MappingNode) else "; here it is a list"
