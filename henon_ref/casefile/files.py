"""Case files: found by path or name, and read into a tree in which every key and value has its line and column.

The cases that are installed with the package are in ``cases/`` at the top of the repository; a wheel contains that
folder, stored truths included, as ``henon_ref/cases``. Events of the YAML 1.2 parser are processed one by one, so that
depth, size and aliases are bounded while the file is read. A scalar keeps its text: ``0.1`` remains an exact decimal
number. Plain scalars are resolved by the core schema of YAML 1.2 (``yes`` is text, ``1e-6`` is a number).
"""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterator
from decimal import Decimal
from difflib import get_close_matches
from functools import cache
from pathlib import Path

from ruamel.yaml import YAML
from ruamel.yaml import events as ev
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.reader import ReaderError

from henon_ref.errors import CaseError
from henon_ref.system.tree import MappingNode, Node, Place, Scalar, ScalarNode, SequenceNode, mapping, sequence
from henon_ref.text import listed, shortened

SUFFIXES = (".yaml", ".yml")
_PACKAGE = Path(__file__).resolve().parents[1]
CASE = "case file"
MAX_BYTES = 256 * 1024
"""Largest size of a file [bytes]."""
MAX_NODES = 20_000
"""Largest number of keys and values of a file, aliases expanded."""
MAX_DEPTH = 32
"""Largest depth of nested mappings and sequences."""

_NAMED_SCALARS: dict[str, Scalar] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}


def shipped_folder() -> Path:
    """Return the folder of the shipped cases, in an installed wheel or in a clone of the repository."""
    inside = _PACKAGE / "cases"
    return inside if inside.is_dir() else _PACKAGE.parent / "cases"


@cache
def shipped_names() -> dict[str, Path]:
    """Return the names of all shipped cases and folders of cases, with their paths.

    A case in a folder has two names, such as ``grazing`` and ``hard/grazing``; ``cases`` means all cases.
    """
    top = shipped_folder()
    if not top.is_dir():
        return {}
    files = yaml_files(top)
    names = {"cases": top}
    names |= {folder.relative_to(top).as_posix(): folder for folder in {file.parent for file in files} - {top}}
    names |= {file.stem: file for file in files}
    return names | {file.relative_to(top).with_suffix("").as_posix(): file for file in files}


def yaml_files(folder: Path) -> list[Path]:
    """Return the case files below a folder in order, except those in a folder ``truth``."""
    return sorted(
        file
        for file in folder.rglob("*")
        if file.suffix in SUFFIXES and "truth" not in file.relative_to(folder).parts[:-1] and file.is_file()
    )


def located(path: str | Path) -> Path:
    """Return the file or folder of an existing path, or else of the shipped cases of that name.

    Examples are ``my_case.yaml``, ``my_folder``, ``fig8``, ``hard``, ``hard/grazing``. CaseError if the name is
    neither. (A missing file ``.yaml`` raises an error when it is read.)
    """
    path = Path(path)
    if os.path.lexists(path) or path.is_absolute() or path.suffix in SUFFIXES:
        return path
    names = shipped_names()
    if (name := path.as_posix()) in names:
        return names[name]
    similar = get_close_matches(name, names, n=3, cutoff=0.5)
    hint = f"similar names: {listed(similar)}" if similar else "henon-ref cases lists the names"
    raise CaseError(f"no file, folder or shipped case has this name; {hint}", file=str(path))


def case_files(path: Path) -> list[Path]:
    """Return the case files that a path, or the name of shipped cases, denotes, in order; CaseError if none."""
    path = located(path)
    if not path.is_dir():
        return [path]
    found = yaml_files(path)
    if not found:
        raise CaseError(f"no case file (*{SUFFIXES[0]}) in this folder", file=str(path))
    return found


def read_yaml(path: str | Path, what: str = CASE) -> MappingNode:
    """Read a file whose top level is a mapping; ``what``: the kind of file, for messages.

    CaseError with file, line and column, if it is not a regular file, too large, not UTF-8, not YAML, or has more than
    one document, a duplicate key, a tag, a merge key, or too large an expansion of aliases.
    """
    return parse_yaml(_text_of(Path(path), what), file=str(path), what=what)


def parse_yaml(text: str, *, file: str | None = None, what: str = CASE) -> MappingNode:
    """Read YAML text whose top level is a mapping (see :func:`read_yaml`)."""
    reader = _Reader(text, file, what)
    node = reader.document()
    if not isinstance(node, MappingNode):
        empty = "" if node else "the file is empty; "
        message = f"{empty}a {what} is a mapping of keys to values, beginning with 'schema: 1'"
        raise reader.error(message, node.place if node else Place(1, 1))
    return node


def _text_of(path: Path, what: str) -> str:
    def error(message: str, line: int | None = None, column: int | None = None) -> CaseError:
        return CaseError(message, file=str(path), line=line, column=column)

    try:
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            raise error(f"this is a folder; give a {what} (YAML)")
        if not stat.S_ISREG(mode):
            raise error(f"this is not a regular file; give a {what} (YAML)")
        with path.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise error("there is no such file") from None
    except (OSError, ValueError) as found:
        raise error(f"cannot be read: {getattr(found, 'strerror', None) or found}") from None
    if len(data) > MAX_BYTES:
        raise error(f"the file is larger than {MAX_BYTES // 1024} KiB, the limit for a {what}")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as found:
        line, column = data.count(b"\n", 0, found.start) + 1, found.start - data.rfind(b"\n", 0, found.start)
        raise error(f"byte 0x{data[found.start]:02x} is not UTF-8; save the file as UTF-8", line, column) from None


class _Reader:
    """Builder of the tree from the parser's events, bounded in depth and size."""

    def __init__(self, text: str, file: str | None, what: str) -> None:
        self.text, self.file = text, file
        self.several = f"several YAML documents; a {what} is one document, without a second '---'"
        self.events = self._events()
        self.anchors: dict[str, Node | None] = {}
        """Anchor -> its node; None while the node is being built."""
        self.nodes = 0

    def error(self, message: str, at: Place | ev.Event) -> CaseError:
        place = at if isinstance(at, Place) else _place(at)
        return CaseError(message, file=self.file, line=place.line, column=place.column)

    def _events(self) -> Iterator[ev.Event]:
        """Yield the parser's events; errors of the parser become errors of the file."""
        end = Place(1, 1)
        try:
            for event in YAML(typ="safe", pure=True).parse(self.text):
                end = Place(event.end_mark.line + 1, event.end_mark.column + 1)
                yield event
        except MarkedYAMLError as error:
            raise self._from_marked(error) from None
        except ReaderError as error:
            before = self.text[: error.position]
            place = Place(before.count("\n") + 1, len(before) - before.rfind("\n"))
            raise self.error("a control character that YAML does not allow", place) from None
        except (AssertionError, ArithmeticError, ValueError):
            # The parser's own checks of '%YAML 1.3' and of "\U00110000" give no place.
            what = "a YAML version other than 1.1 and 1.2, or a character number above 10FFFF"
            raise self.error(f"not YAML after this place: {what}", end) from None

    def _from_marked(self, error: MarkedYAMLError) -> CaseError:
        mark = error.problem_mark or error.context_mark
        message = " ".join(str(part) for part in (error.context, error.problem) if part)
        hint = "; indent with spaces in YAML" if "\\t" in message or "'\t'" in message else ""
        if "expected a single document" in message:
            return CaseError(self.several, file=self.file)
        place = Place(mark.line + 1, mark.column + 1) if mark is not None else Place(1, 1)
        return self.error(f"not YAML: {' '.join(message.split())}{hint}", place)

    def document(self) -> Node | None:
        """Return the one document of the stream; None if there is none."""
        root: Node | None = None
        for event in self.events:
            if isinstance(event, ev.StreamEndEvent):
                break
            if isinstance(event, ev.DocumentStartEvent):
                if root is not None:
                    raise self.error(self.several, event)
                root = self._node(next(self.events), 0)
        return root

    def _count(self, size: int, event: ev.Event) -> None:
        self.nodes += size
        if self.nodes > MAX_NODES:
            raise self.error(f"more than {MAX_NODES} keys and values (aliases expanded)", event)

    def _node(self, event: ev.Event, depth: int) -> Node:
        if isinstance(event, ev.AliasEvent):
            return self._alias(event)
        assert isinstance(event, ev.ScalarEvent | ev.MappingStartEvent | ev.SequenceStartEvent)
        if event.tag is not None:
            raise self.error(f"the tag '{event.tag}' is not allowed; write plain YAML without tags", event)
        if depth > MAX_DEPTH:
            raise self.error(f"nested deeper than {MAX_DEPTH}", event)
        anchor = event.anchor
        if anchor is not None:
            self.anchors[anchor] = None
        self._count(1, event)
        node: Node
        if isinstance(event, ev.MappingStartEvent):
            node = self._mapping(event, depth)
        elif isinstance(event, ev.SequenceStartEvent):
            node = self._sequence(event, depth)
        else:
            node = self._scalar(event)
        if anchor is not None:
            self.anchors[anchor] = node
        return node

    def _alias(self, event: ev.AliasEvent) -> Node:
        if event.anchor not in self.anchors:
            raise self.error(f"the alias '*{event.anchor}' has no anchor '&{event.anchor}' before it", event)
        node = self.anchors[event.anchor]
        if node is None:
            raise self.error(f"the alias '*{event.anchor}' contains itself", event)
        self._count(node.size, event)
        return node

    def _sequence(self, start: ev.Event, depth: int) -> SequenceNode:
        items: list[Node] = []
        for event in self.events:
            if isinstance(event, ev.SequenceEndEvent):
                break
            items.append(self._node(event, depth + 1))
        return sequence(items, _place(start))

    def _mapping(self, start: ev.Event, depth: int) -> MappingNode:
        entries: dict[str, Node] = {}
        keys: dict[str, Place] = {}
        for event in self.events:
            if isinstance(event, ev.MappingEndEvent):
                break
            key = self._key(event, depth)
            if key in entries:
                raise self.error(f"the key '{key}' is given twice (first in line {keys[key].line})", event)
            keys[key] = _place(event)
            value = self._node(next(self.events), depth + 1)
            if isinstance(value, ScalarNode) and not value.text and value.value is None:
                # The parser places an absent value after the next token; it belongs to its key.
                value = ScalarNode(keys[key], None, "", None)
            entries[key] = value
        return mapping(entries, _place(start), keys)

    def _key(self, event: ev.Event, depth: int) -> str:
        node = self._node(event, depth + 1)
        if not isinstance(node, ScalarNode) or not isinstance(node.value, str) or not node.value:
            raise self.error("a key must be a name (text), not a number, a list, a mapping or empty", event)
        if node.value == "<<":
            raise self.error("the merge key '<<' is not YAML 1.2; repeat the keys, or use an alias", event)
        return node.value

    def _scalar(self, event: ev.ScalarEvent) -> ScalarNode:
        place, text = _place(event), event.value
        one_line = event.start_mark.line == event.end_mark.line
        width = event.end_mark.column - event.start_mark.column
        if event.style is None:
            return ScalarNode(place, self._core(text, place), text, place if one_line else None)
        same = one_line and event.style in "'\"" and width == len(text) + 2
        return ScalarNode(place, text, text, Place(place.line, place.column + 1) if same else None)

    def _core(self, text: str, place: Place) -> Scalar:
        """Resolve a plain scalar by the core schema of YAML 1.2."""
        if text in _NAMED_SCALARS:
            return _NAMED_SCALARS[text]
        if re.fullmatch(r"[-+]?[0-9]{1,400}", text):
            return int(text)
        if re.fullmatch(r"0o[0-7]{1,400}|0x[0-9a-fA-F]{1,400}", text):
            return int(text, 0)
        if re.fullmatch(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]{1,5})?", text):
            if len(text) > 800:
                raise self.error(f"the number {shortened(text, 24)} is too long", place)
            return Decimal(text)
        if re.fullmatch(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)", text):
            return Decimal(text.replace(".", "").lower())
        return text


def _place(event: ev.Event) -> Place:
    return Place(event.start_mark.line + 1, event.start_mark.column + 1)
