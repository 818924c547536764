"""The C compiler that builds the libraries: this machine's, or else the one in the package ``ziglang``."""

from __future__ import annotations

import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

ZIGLANG = "ziglang==0.17.0"
"""A compiler with the C library's headers and symbols, as a package: pinned here, since constraints do not reach the
environment that pip builds in."""
GLIBC = "2.28"
"""The oldest glibc that what ``ziglang`` compiles runs with: manylinux_2_28."""
COMMANDS = ("cc", "gcc", "clang")
TRIAL = """#include <math.h>
#include <stdint.h>
double trial(double x, int32_t n) { return pow(x, n) + __builtin_fma(x, x, 1.0); }
"""
"""A file that compiles where there are the headers and the C library, too."""


class CompilerError(Exception):
    """There is no compiler that works; the message is one sentence."""


class Compiler(NamedTuple):
    """A C compiler."""

    command: tuple[str, ...]
    wheel_platform: str | None = None
    """Platform tag of a wheel with what it compiles, where that is not this machine's."""
    is_ziglang: bool = False

    def line(self, flags: tuple[str, ...], architecture: str | None, source: str, library: str) -> list[str]:
        """The command line that compiles a source to a library for a processor's architecture."""
        further = ["-Wl,--build-id=none"] if sys.platform == "linux" else []
        if architecture is not None:
            spelt = architecture.replace("-", "_") if self.is_ziglang else architecture
            further.append(f"-march={spelt}")
        return [*self.command, *flags, *further, source, "-o", library, "-lm"]


def choose(flags: tuple[str, ...], architectures: list[str | None]) -> Compiler:
    """The machine's compiler (``CC``, or cc, gcc, clang) if it works with some flags, or else that of ``ziglang``.

    ``CC=ziglang`` asks for the package where there is a compiler, too.

    Raises
    ------
    CompilerError
        Where neither is there.
    """
    asked = os.environ.get("CC", "").strip()
    if asked != "ziglang":
        for text in [asked] if asked else COMMANDS:
            found = Compiler(tuple(shlex.split(text)))
            if all(_works(found, flags, own) for own in architectures):
                return found
        if asked:
            processors = " and ".join(own or "this processor" for own in architectures)
            raise CompilerError(f"CC is {asked!r}, which does not compile for {processors} with {shlex.join(flags)}")
    if find_spec("ziglang") is not None:
        return _ziglang()
    raise CompilerError(
        f"there is no C compiler that works ({', '.join(COMMANDS)}), and the package ziglang, which holds one, is not "
        f"installed: install one of them (apt-get install gcc libc6-dev, or pip install {ZIGLANG})"
    )


def _works(compiler: Compiler, flags: tuple[str, ...], architecture: str | None) -> bool:
    """Whether a compiler makes a library of three lines."""
    if shutil.which(compiler.command[0]) is None:
        return False
    with tempfile.TemporaryDirectory() as folder:
        source, library = Path(folder, "trial.c"), Path(folder, "trial.so")
        source.write_text(TRIAL, encoding="utf-8")
        line = compiler.line(flags, architecture, str(source), str(library))
        return subprocess.run(line, capture_output=True, check=False).returncode == 0 and library.exists()


def _ziglang() -> Compiler:
    """The package's compiler: on Linux for the oldest glibc that wheels are made for, elsewhere for this system."""
    command = (sys.executable, "-m", "ziglang", "cc")
    if sys.platform != "linux":
        return Compiler(command, is_ziglang=True)
    machine = platform.machine()
    target = ("-target", f"{machine}-linux-gnu.{GLIBC}")
    return Compiler((*command, *target), f"manylinux_{GLIBC.replace('.', '_')}_{machine}", is_ziglang=True)
