"""YAML files: the core schema of 1.2, places, and bounded work on hostile files."""

from __future__ import annotations

import os
from decimal import Decimal
from pathlib import Path

import pytest

from henon_ref.casefile.files import MAX_BYTES, parse_yaml, read_yaml
from henon_ref.errors import CaseError
from henon_ref.system.tree import Place, ScalarNode, child, locate, merged, to_python


def test_scalars_follow_the_core_schema_of_yaml_1_2() -> None:
    text = "{a: 1e-6, b: 0x1F, c: yes, d: true, e: ~, f: '1', g: 0.10, h: 1_000, i: -.5, j: 0o17, k: on}"
    assert to_python(parse_yaml(text)) == {
        "a": Decimal("1e-6"),
        "b": 31,
        "c": "yes",
        "d": True,
        "e": None,
        "f": "1",
        "g": Decimal("0.10"),
        "h": "1_000",
        "i": Decimal("-0.5"),
        "j": 15,
        "k": "on",
    }


def test_keys_and_values_know_their_places() -> None:
    tree = parse_yaml("a: 1\nb:\n  - x\n  - {c: 'it'}\nd:\n")
    assert locate(tree, ["b", 1, "c"], key=True) == Place(4, 6)
    assert locate(tree, ["b", 1, "c"]) == Place(4, 9)
    assert locate(tree, ["b", 7, "c"]) == Place(3, 3)
    # A value that is not there stands at its key.
    assert locate(tree, ["d"]) == Place(5, 1)
    node = child(tree, ["b", 1, "c"])
    assert isinstance(node, ScalarNode)
    assert node.text_place == Place(4, 10)


def test_overrides_merge_mappings_replace_the_rest_and_null_removes() -> None:
    base = parse_yaml("{a: {x: 1, y: 2}, b: [1, 2], c: 3}")
    over = parse_yaml("{a: {y: 5}, b: [9], c: null, d: 4}")
    assert to_python(merged(base, over)) == {"a": {"x": 1, "y": 5}, "b": [9], "d": 4}


BOMB = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{new}: &{new} [{','.join(['*' + old] * 9)}]\n" for old, new in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.mark.parametrize(
    ("text", "place", "says"),
    [
        (BOMB, "5:11", "aliases expanded"),
        ("a: &x {b: *x}", "1:11", "contains itself"),
        ("a: *x", "1:4", "no anchor"),
        ("a: 1\nb: 2\na: 3", "3:1", "twice (first in line 1)"),
        ("1: 2", "1:1", "a key must be a name"),
        ("? [k]\n: v", "1:3", "a key must be a name"),
        ("a: !foo 1", "1:4", "'!foo' is not allowed"),
        ("a: !!python/object/apply:os.system [true]", "1:4", "is not allowed"),
        ("<<: {a: 1}", "1:1", "merge key"),
        ("a: 1\n---\nb: 2", "2:1", "several YAML documents"),
        ("[a]", "1:1", "a case file is a mapping"),
        ("", "1:1", "the file is empty"),
        ("# nothing\n", "1:1", "the file is empty"),
        ("a: " + "[" * 5000, "1:36", "nested deeper"),
        ("a:\n\t- b", "2:1", "not YAML"),
        ("a: {b: 1", "1:9", "not YAML"),
        ("a: 'x", "1:6", "not YAML"),
        ("a: b\x07", "1:5", "control character"),
        ("%YAML 1.3\n---\na: 1", "1:1", "a YAML version other than 1.1 and 1.2"),
        ('a: 1\nb: "\\U00110000"', "2:2", "a character number above 10FFFF"),
        ('a: 1\nb: "\\UFFFFFFFF"', "2:2", "a character number above 10FFFF"),
    ],
)
def test_a_hostile_or_broken_file_is_refused_with_its_place(text: str, place: str, says: str) -> None:
    with pytest.raises(CaseError) as caught:
        parse_yaml(text, file="f.yaml")
    assert str(caught.value).startswith(f"f.yaml:{place}: ")
    assert says in caught.value.message
    assert "\n" not in str(caught.value)


def test_a_path_that_is_no_file_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path, says in (
        (tmp_path, "folder"),
        (tmp_path / "missing.yaml", "no such file"),
        (tmp_path / "pipe", "not a regular file"),
        (tmp_path / "a\0b", "cannot be read"),
    ):
        with pytest.raises(CaseError, match=says):
            read_yaml(path)


def test_bytes_are_bounded_and_must_be_utf_8(tmp_path: Path) -> None:
    path = tmp_path / "case.yaml"
    path.write_bytes(b"a" * (MAX_BYTES + 1))
    with pytest.raises(CaseError, match="larger than"):
        read_yaml(path)
    path.write_bytes(b"a: 1\nb: \xe9")
    with pytest.raises(CaseError, match="UTF-8") as caught:
        read_yaml(path)
    assert (caught.value.line, caught.value.column) == (2, 4)
    path.write_bytes("\ufeffa: 1".encode())
    assert to_python(read_yaml(path)) == {"a": 1}
