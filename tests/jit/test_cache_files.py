"""Files of the cache are read as they were written, or not at all."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import Any

import pytest

from henon_ref.jit.cache_files import DamagedError, read, set_aside, write

unix = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="modes and owners as on Unix")
CONTENT = bytes(range(256))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "folder" / "file"


def test_what_was_written_is_read(file: Path) -> None:
    assert read(file) is None
    write(file, b"before")
    write(file, CONTENT)
    assert read(file) == CONTENT
    assert list(file.parent.iterdir()) == [file]


@unix
def test_only_the_user_can_read_and_write_it(file: Path) -> None:
    write(file, CONTENT)
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert stat.S_IMODE(file.parent.stat().st_mode) == 0o700


@pytest.mark.parametrize("place", [0, 31, 32, 100, -1])
def test_a_flipped_bit_is_noticed(file: Path, place: int) -> None:
    write(file, CONTENT)
    found = bytearray(file.read_bytes())
    found[place] ^= 1
    file.write_bytes(found)
    with pytest.raises(DamagedError, match="checksum"):
        read(file)


@pytest.mark.parametrize("length", [0, 1, 32, 287])
def test_a_truncated_or_empty_file_is_noticed(file: Path, length: int) -> None:
    write(file, CONTENT)
    os.truncate(file, length)
    with pytest.raises(DamagedError, match="checksum"):
        read(file)


def test_a_file_under_another_name_is_noticed(file: Path) -> None:
    write(file, CONTENT)
    other = file.rename(file.with_name("other"))
    with pytest.raises(DamagedError, match="checksum"):
        read(other)


@unix
@pytest.mark.parametrize("mode", [0o620, 0o602, 0o666])
def test_a_file_that_others_can_write_is_not_read(file: Path, mode: int) -> None:
    write(file, CONTENT)
    file.chmod(mode)
    with pytest.raises(DamagedError, match="others can write"):
        read(file)


@unix
def test_a_file_of_another_user_is_not_read(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(file, CONTENT)
    monkeypatch.setattr(os, "geteuid", lambda: 12345)
    with pytest.raises(DamagedError, match="another user"):
        read(file)


@unix
def test_links_pipes_and_folders_are_not_read(file: Path) -> None:
    write(file, CONTENT)
    link, pipe, folder = (file.with_name(name) for name in ("link", "pipe", "folder"))
    link.symlink_to(file)
    os.mkfifo(pipe)
    folder.mkdir()
    for other in (link, pipe, folder):
        with pytest.raises(DamagedError):
            read(other)


@unix
def test_what_a_link_leads_to_is_not_written(file: Path) -> None:
    outside = file.parent.parent / "outside"
    outside.write_bytes(b"as it was")
    file.parent.mkdir()
    file.symlink_to(outside)
    write(file, CONTENT)
    assert outside.read_bytes() == b"as it was"
    assert read(file) == CONTENT


def test_what_cannot_be_written_leaves_what_was_there(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(file, CONTENT)

    def full(*_: Any, **__: Any) -> Any:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OSError):
        write(file, b"new")
    assert read(file) == CONTENT
    assert list(file.parent.iterdir()) == [file]


def test_the_folder_of_all_is_not_made_again(file: Path) -> None:
    """A temporary one that was removed would come back for good."""
    with pytest.raises(FileNotFoundError):
        write(file.parent / "another" / "file", CONTENT)


def test_a_folder_is_set_aside_once(file: Path) -> None:
    """Who has met the same damage, but comes second, leaves the new folder where it is."""
    write(file, CONTENT)
    file.write_bytes(b"damaged")
    damages = []
    for _ in range(2):
        with pytest.raises(DamagedError) as raised:
            read(file)
        damages.append(raised.value)
    set_aside(file.parent, damages[0])
    assert not file.exists()
    write(file, b"new")
    set_aside(file.parent, damages[1])
    assert read(file) == b"new"
    (aside,) = file.parent.parent.glob("set-aside-folder-*")
    assert (aside / "file").read_bytes() == b"damaged"
