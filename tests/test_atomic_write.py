"""Files are written whole or not at all, and an error names the file."""

from __future__ import annotations

import errno
import os
import threading
from pathlib import Path

import pytest

from henon_ref.atomic_write import replace_file

pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes")


@pipes
def test_a_pipe_that_nobody_reads_is_an_error_and_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="no process reads this pipe"):
        replace_file(tmp_path / "pipe", b"1")


@pipes
def test_a_pipe_gets_more_than_it_holds(tmp_path: Path) -> None:
    pipe, content, found = tmp_path / "pipe", b"1" * 2**20, []
    os.mkfifo(pipe)
    with open(os.open(pipe, os.O_RDWR), "rb") as file:  # O_RDWR: it is not at its end before there is a writer
        reader = threading.Timer(0.2, lambda: found.append(file.read(len(content))))
        reader.start()
        replace_file(pipe, content)
        reader.join()
    assert found == [content]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no full device")
def test_a_full_device_is_named() -> None:
    with pytest.raises(OSError, match="/dev/full") as caught:
        replace_file(Path("/dev/full"), b"1")
    assert caught.value.errno == errno.ENOSPC


def test_a_full_disk_is_told_with_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    (tmp_path / "a").write_text("before")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left on device") as caught:
        replace_file(tmp_path / "a", b"1")
    assert Path(caught.value.filename).parent == tmp_path
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("a", "before")]
