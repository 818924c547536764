"""Files of the cache are read as they were written, or not at all."""

from __future__ import annotations

import errno
import logging
import os
import stat
from pathlib import Path
from typing import Any

import pytest

from henon_ref.jit.cache_folder import read, write

unix = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="modes and owners as on Unix")
CONTENT = bytes(range(256))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "folder" / "file"


def assert_refused(file: Path, why: str, caplog: pytest.LogCaptureFixture) -> None:
    """It is not read, and the log says why."""
    caplog.clear()
    with caplog.at_level(logging.INFO):
        assert read(file) is None
    assert str(file) in caplog.text
    assert why in caplog.text


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
def test_a_flipped_bit_is_noticed(file: Path, place: int, caplog: pytest.LogCaptureFixture) -> None:
    write(file, CONTENT)
    found = bytearray(file.read_bytes())
    found[place] ^= 1
    file.write_bytes(found)
    assert_refused(file, "checksum", caplog)


@pytest.mark.parametrize("length", [0, 1, 32, 287])
def test_a_truncated_or_empty_file_is_noticed(file: Path, length: int, caplog: pytest.LogCaptureFixture) -> None:
    write(file, CONTENT)
    os.truncate(file, length)
    assert_refused(file, "checksum", caplog)


def test_a_file_under_another_name_is_noticed(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    write(file, CONTENT)
    other = file.rename(file.with_name("other"))
    assert_refused(other, "checksum", caplog)


@unix
@pytest.mark.parametrize("mode", [0o620, 0o602, 0o666])
def test_a_file_that_others_can_write_is_not_read(file: Path, mode: int, caplog: pytest.LogCaptureFixture) -> None:
    write(file, CONTENT)
    file.chmod(mode)
    assert_refused(file, "others can write", caplog)


@unix
def test_a_file_of_another_user_is_not_read(
    file: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    write(file, CONTENT)
    monkeypatch.setattr(os, "geteuid", lambda: 12345)
    assert_refused(file, "another user", caplog)


@unix
def test_links_pipes_and_folders_are_not_read(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    write(file, CONTENT)
    link, pipe, folder = (file.with_name(name) for name in ("link", "pipe", "folder"))
    link.symlink_to(file)
    os.mkfifo(pipe)
    folder.mkdir()
    for other in (link, pipe, folder):
        assert_refused(other, "", caplog)


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
