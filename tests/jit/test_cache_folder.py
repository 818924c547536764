"""Compiled code is kept in a folder that nobody else can write to, else in a temporary one."""

from __future__ import annotations

import errno
import logging
import os
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from henon_ref.jit import cache_folder as cachefolder
from henon_ref.jit.cache_folder import VARIABLE, cache_root

unix = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="modes and owners as on Unix")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that the variable names; it is not there yet."""
    monkeypatch.setenv(VARIABLE, str(tmp_path / "cache"))
    return tmp_path / "cache"


def assert_replaced(folder: Path, said: str, caplog: pytest.LogCaptureFixture) -> Path:
    """A temporary folder of this user alone is used, and a line tells why."""
    root = cache_root()
    assert str(root) != os.path.realpath(folder)
    assert stat.S_IMODE(root.stat().st_mode) == 0o700
    assert not list(root.iterdir())
    (record,) = caplog.records
    assert record.levelno == logging.WARNING
    assert repr(str(folder)) in record.message
    assert said in record.message
    assert "\n" not in record.message
    assert cache_root() == root
    assert os.environ[VARIABLE] == str(root)  # for processes that are begun from here on
    assert len(caplog.records) == 1
    return root


def test_the_folder_is_made_for_the_user_alone(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    assert cache_root() == folder.resolve()
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert not caplog.records


def test_without_the_variable_it_is_in_the_users_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setattr(cachefolder, "user_cache_path", lambda name: tmp_path / name)
    assert cache_root() == (tmp_path / "henon_ref").resolve()


@unix
@pytest.mark.parametrize("mode", [0o770, 0o707, 0o777, 0o720, 0o702])
def test_a_folder_that_others_can_write_is_not_used(mode: int, folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder.mkdir()
    folder.chmod(mode)
    assert_replaced(folder, f"others can write to it (mode {mode:04o})", caplog)


@unix
@pytest.mark.parametrize("mode", [0o770, 0o707])
def test_nor_is_one_with_such_a_folder_in_it(mode: int, folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    (folder / "objects").mkdir(parents=True)
    (folder / "objects").chmod(mode)
    assert_replaced(folder, f"others can write to it (mode {mode:04o}): 'objects'", caplog)


@unix
def test_nor_is_one_below_a_folder_that_is_open_to_everybody(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder.parent.chmod(0o777)
    assert_replaced(folder, f"others can write to {str(folder.parent)!r}", caplog)
    folder.parent.chmod(0o700)


@unix
def test_a_folder_whose_files_only_their_owner_can_replace_may_be_above(folder: Path) -> None:
    folder.parent.chmod(0o1777)
    assert cache_root() == folder.resolve()
    folder.parent.chmod(0o700)


@unix
@pytest.mark.parametrize("inner", ["", "objects"])
def test_a_folder_of_another_user_is_not_used(
    inner: str, folder: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / inner).mkdir(parents=True)
    if os.geteuid() == 0:
        os.chown(folder / inner, 12345, -1)
    elif inner:
        pytest.skip("only root can give a folder away")
    else:
        monkeypatch.setattr(os, "geteuid", lambda: 12345)
    assert "it belongs to another user" in (cachefolder._refused(folder, folder) or "")
    if os.geteuid() == 0:
        assert_replaced(folder, "it belongs to another user", caplog)


def test_what_is_no_folder_is_not_used(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder.mkdir()
    (folder / "objects").write_text("")
    assert_replaced(folder, "it is not a folder: 'objects'", caplog)


@pytest.mark.parametrize("place", ["cache", "."])
def test_a_file_in_the_place_of_the_folder_or_above_it_is_no_error(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "there").write_text("a file")
    wanted = tmp_path / "there" if place == "." else tmp_path / "there" / place
    monkeypatch.setenv(VARIABLE, str(wanted))
    assert_replaced(wanted, "it is not a folder" if place == "." else "it cannot be written", caplog)


@pytest.mark.parametrize("number", [errno.EROFS, errno.EACCES, errno.ENOSPC, errno.EDQUOT])
def test_a_folder_that_cannot_be_written_is_not_used(
    number: int, folder: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = tempfile.TemporaryFile

    def refuse(**place: Path) -> object:
        if place["dir"] == folder.resolve():
            raise OSError(number, os.strerror(number))
        return original(**place)

    monkeypatch.setattr(tempfile, "TemporaryFile", refuse)
    assert_replaced(folder, f"it cannot be written ({os.strerror(number)})", caplog)


def test_where_no_folder_can_be_had_nothing_is_kept(
    folder: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(**_: object) -> object:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(tempfile, "TemporaryFile", full)
    root = cache_root()
    assert not root.exists()
    with pytest.raises(OSError):
        root.mkdir()
    assert "compiled code is not kept" in caplog.text


@unix
def test_a_link_of_ones_own_leads_to_the_folder_that_is_used(folder: Path) -> None:
    (folder.parent / "elsewhere").mkdir(mode=0o700)
    folder.symlink_to("elsewhere")
    assert cache_root() == (folder.parent / "elsewhere").resolve()


@unix
def test_what_a_link_leads_to_is_under_the_same_rules(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    (folder.parent / "elsewhere").mkdir()
    (folder.parent / "elsewhere").chmod(0o777)
    folder.symlink_to("elsewhere")
    assert_replaced(folder, "others can write to it (mode 0777)", caplog)


@unix
@pytest.mark.skipif(os.name == "posix" and os.geteuid() != 0, reason="only root can give a link away")
def test_a_link_of_another_user_is_not_used(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder.symlink_to("elsewhere")
    os.chown(folder, 12345, -1, follow_symlinks=False)
    assert_replaced(folder, "it is a link of another user", caplog)
    assert not (folder.parent / "elsewhere").exists()


@unix
def test_a_link_that_leads_nowhere_but_to_itself_is_not_used(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder.symlink_to(folder.name)
    assert_replaced(folder, "", caplog)


@unix
def test_a_link_in_the_place_of_a_folder_inside_is_not_used(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder.mkdir(mode=0o700)
    (folder.parent / "elsewhere").mkdir(mode=0o700)
    (folder / "objects").symlink_to(folder.parent / "elsewhere")
    assert_replaced(folder, "it is not a folder: 'objects'", caplog)


CHILD = """
import multiprocessing, os, sys
from henon_ref.jit.cache_folder import cache_root

def told(connection):
    connection.send(str(cache_root()))

if __name__ == "__main__":
    own = cache_root()
    ours, theirs = multiprocessing.Pipe()
    child = multiprocessing.get_context("fork").Process(target=told, args=(theirs,))
    child.start()
    assert ours.recv() == str(own)
    child.join()
    assert own.is_dir()
    print(own)
"""


def test_the_temporary_folder_is_shared_with_processes_begun_and_removed_at_the_end(tmp_path: Path) -> None:
    wanted = tmp_path / "cache"
    wanted.write_text("")
    environment = {**os.environ, VARIABLE: str(wanted)}
    done = subprocess.run([sys.executable, "-c", CHILD], env=environment, capture_output=True, text=True, check=True)
    assert not Path(done.stdout.strip()).exists()
    assert done.stderr.count("\n") == 1


def test_a_name_from_outside_is_one_short_printable_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "there").write_text("a file")
    monkeypatch.setenv(VARIABLE, str(tmp_path / "there" / ("\x1b[31m\n" * 500)))
    cache_root()
    assert caplog.records[0].message.isprintable()
    assert len(caplog.records[0].message) < 1000
