"""Programs that are started by tests of workers, and whether their processes have ended."""

from __future__ import annotations

import textwrap
import time
from pathlib import Path


def gone(pid: int) -> bool:
    """Whether a process is no more (or is only waiting to be reaped by somebody else)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except FileNotFoundError:
        return True


def wait_until(true, seconds: float = 600.0) -> None:
    deadline = time.monotonic() + seconds
    while not true() and time.monotonic() < deadline:
        time.sleep(0.02)
    assert true()


def script(folder: Path, begin: str, code: str) -> Path:
    """A program that has these tests' jobs."""
    path = folder / "caller.py"
    head = textwrap.dedent(f"""
        import os, sys
        os.sched_getaffinity = lambda process: {{0, 1}}
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        from jobs import Act, run
        """)
    inside = textwrap.indent(textwrap.dedent(begin) + "\n" + textwrap.dedent(code), "    ")
    path.write_text(f'{head}\nif __name__ == "__main__":\n{inside}\n')
    return path
