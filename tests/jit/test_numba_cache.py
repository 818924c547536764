"""numba's compiled functions on disk: used again, and compiled anew wherever anything is wrong."""

from __future__ import annotations

import errno
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import pytest
from numba import float64, int64

from henon_ref.jit import cache_files as cachefiles
from henon_ref.jit import numba_cache as numbacache
from henon_ref.jit.cache_folder import VARIABLE, cache_root
from henon_ref.jit.numba_cache import CheckedCache


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    return cache_root() / "numba-0123456789abcdef"


def twice(x):  # type: ignore[no-untyped-def]
    return 2 * x


def called(folder: Path, kind: Any = float64) -> bool:
    """Call the function as a new process would; whether it was loaded from the folder."""
    compiled: Any = numba.njit(twice)
    compiled._cache = CheckedCache(twice, folder)
    compiled.compile((kind,))
    assert compiled(21.0 if kind is float64 else 21) == 42
    return bool(compiled.stats.cache_hits)


def asides(folder: Path) -> list[Path]:
    return sorted(folder.parent.glob(f"set-aside-{folder.name}-*"))


def test_a_function_is_compiled_once_for_each_type(folder: Path) -> None:
    assert [called(folder), called(folder), called(folder, int64)] == [False, True, False]
    assert [called(folder), called(folder, int64)] == [True, True]
    assert {file.suffix for file in folder.iterdir()} == {".nbi", ".nbc"}
    assert not asides(folder)


def empty(file: Path) -> None:
    os.truncate(file, 0)


def shorten(file: Path) -> None:
    os.truncate(file, file.stat().st_size // 2)


def flip(file: Path) -> None:
    found = bytearray(file.read_bytes())
    found[len(found) // 2] ^= 4
    file.write_bytes(found)


def open_to_all(file: Path) -> None:
    file.chmod(0o666)


def make_folder(file: Path) -> None:
    file.unlink()
    file.mkdir()


def make_link(file: Path) -> None:
    file.symlink_to(file.rename(file.with_name("elsewhere")))


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("spoil", [empty, shorten, flip, open_to_all, make_folder, make_link])
def test_a_damaged_folder_is_set_aside_and_made_anew(folder: Path, suffix: str, spoil: Callable[[Path], None]) -> None:
    called(folder)
    (file,) = folder.glob(f"*{suffix}")
    spoil(file)
    assert [called(folder), called(folder)] == [False, True]
    assert len(asides(folder)) == 1


class Bomb:
    """Writes a file when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.write_text, (self.mark, "unpickled")


def test_nothing_is_unpickled_that_was_not_written_here(folder: Path, tmp_path: Path) -> None:
    called(folder)
    for file in list(folder.iterdir()):
        content = pickle.dumps(Bomb(tmp_path / "mark"))
        file.write_bytes(content)
        assert not called(folder)
        file.write_bytes(file.read_bytes()[:32] + content)
        assert not called(folder)
    assert not (tmp_path / "mark").exists()


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("content", [b"", b"no pickle", pickle.dumps(None), pickle.dumps((1, 2, 3)), pickle.dumps({})])
def test_what_was_written_whole_but_cannot_be_used_is_compiled_anew(folder: Path, suffix: str, content: bytes) -> None:
    called(folder)
    (file,) = folder.glob(f"*{suffix}")
    cachefiles.write(file, content)
    assert [called(folder), called(folder)] == [False, True]


def test_a_file_that_is_missing_is_written_again(folder: Path) -> None:
    called(folder)
    for suffix in (".nbi", ".nbc"):
        next(folder.glob(f"*{suffix}")).unlink()
        assert [called(folder), called(folder)] == [False, True]
    assert not asides(folder)


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EFBIG, errno.EIO])
def test_what_cannot_be_written_is_no_error(folder: Path, number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(file: Path, content: bytes) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(numbacache, "write", refuse)
    assert [called(folder), called(folder)] == [False, False]
    assert list(folder.parent.glob(f"unwritten-{number}-*"))


@pytest.mark.parametrize("where", [Path(os.devnull, "henon_ref"), Path(__file__)], ids=["nowhere", "a file"])
def test_where_there_is_no_folder_each_process_compiles(folder: Path, where: Path) -> None:
    assert [called(where / "numba-0"), called(where / "numba-0")] == [False, False]


def test_a_change_of_the_source_is_noticed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    called(folder)
    monkeypatch.setattr(numbacache, "_stamp", lambda source: "another text")
    assert [called(folder), called(folder)] == [False, True]
    assert not asides(folder)
