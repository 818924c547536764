"""Processes take turns to compile; where no turns can be taken, each compiles for itself."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import pytest

from henon_ref.jit import shared_compiling as sharing
from henon_ref.jit.cache_files import open_turn
from henon_ref.jit.shared_compiling import compile_all

fcntl = pytest.importorskip("fcntl", reason="locks as on Unix")
TYPES = ("types",)


class Function:
    """In place of a compiled function."""

    def __init__(self) -> None:
        self.overloads: dict[Any, str] = {}

    def compile(self, types: Any) -> None:
        self.overloads[types] = "compiled"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(sharing, "cache_folder", lambda: tmp_path / "folder")
    return tmp_path / "folder"


@pytest.fixture
def function() -> Any:
    made = Function()
    made.__name__ = "function"  # type: ignore[attr-defined]
    return made


def turn(function: Any) -> Path:
    return sharing._turn(function, TYPES)


def assert_compiled(function: Any) -> None:
    compile_all([(function, TYPES)])
    assert function.overloads == {TYPES: "compiled"}


def test_who_compiles_says_so(folder: Path, function: Any) -> None:
    assert_compiled(function)
    assert turn(function).read_bytes() == b"compiled\n"


def test_a_file_in_the_place_of_the_folder_is_no_error(folder: Path, function: Any) -> None:
    folder.write_text("")
    assert_compiled(function)


def test_what_is_no_file_in_the_place_of_a_turn_is_no_error(folder: Path, function: Any) -> None:
    folder.mkdir()
    os.mkfifo(turn(function))
    assert_compiled(function)


def test_a_link_in_the_place_of_a_turn_is_not_followed(folder: Path, function: Any) -> None:
    folder.mkdir()
    outside = folder.parent / "outside"
    outside.write_bytes(b"")
    turn(function).symlink_to(outside)
    assert_compiled(function)
    assert outside.read_bytes() == b""


def test_a_disk_without_locks_is_no_error(folder: Path, function: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", none)
    assert_compiled(function)


def test_a_full_disk_is_no_error(folder: Path, function: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.mkdir()
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("there is no device that is always full")
    monkeypatch.setattr(sharing, "open_turn", lambda _: open_turn(full))
    monkeypatch.setattr(sharing, "_is_made", lambda made, types: types in made.overloads)
    assert_compiled(function)


def test_what_another_process_is_at_comes_last_and_is_compiled_there_alone(folder: Path, function: Any) -> None:
    """Another one is compiled meanwhile; ``compile`` is called for both at the end, and takes them from the disk."""
    order = []

    class Other(Function):
        __name__ = "other"

        def compile(self, types: Any) -> None:
            if types not in self.overloads:
                held.write(b"compiled\n")
                held.close()  # the other process has done its part
            order.append("other")
            super().compile(types)

    function.compile = lambda types: order.append("function")
    folder.mkdir()
    held = open_turn(turn(function))
    fcntl.flock(held, fcntl.LOCK_EX)
    compile_all([(function, TYPES), (Other(), TYPES)])
    assert order == ["other", "function", "other"]


def test_a_process_that_hangs_in_its_turn_is_not_waited_for(
    folder: Path, function: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sharing, "LONGEST_WAIT", 0.1)
    with open_turn(turn(function)) as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert_compiled(function)
