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
PLATFORM_VARIABLE = "HENON_REF_PLATFORM"
"""Environment variable: the platform of ``PLATFORMS`` to build a wheel for; without it, the machine's own."""
COMMANDS = ("cc", "gcc", "clang")
TRIAL = """#include <math.h>
#include <stdint.h>
double trial(double x, int32_t n) { return pow(x, n) + __builtin_fma(x, x, 1.0); }
"""
"""A file that compiles where there are the headers and the C library, too."""


class Platform(NamedTuple):
    """What wheels are built for."""

    machine: str
    """As ``platform.machine`` says it there."""
    target: str
    """As ``ziglang`` says it."""
    wheel: str
    """As the name of a wheel says it."""


PLATFORMS = {
    "linux-x86_64": Platform("x86_64", f"x86_64-linux-gnu.{GLIBC}", f"manylinux_{GLIBC.replace('.', '_')}_x86_64"),
    "linux-aarch64": Platform("aarch64", f"aarch64-linux-gnu.{GLIBC}", f"manylinux_{GLIBC.replace('.', '_')}_aarch64"),
    "macos-arm64": Platform("arm64", "aarch64-macos.11.0", "macosx_11_0_arm64"),
    "macos-x86_64": Platform("x86_64", "x86_64-macos.11.0", "macosx_11_0_x86_64"),
    "windows-x86_64": Platform("AMD64", "x86_64-windows-gnu", "win_amd64"),
}
"""``ziglang`` compiles for each of them on any machine."""


class CompilerError(Exception):
    """There is no compiler that works; the message is one sentence."""


class Compiler(NamedTuple):
    """A C compiler."""

    command: tuple[str, ...]
    wheel_platform: str | None = None
    """Platform tag of a wheel with what it compiles, where that is not this machine's."""
    is_ziglang: bool = False
    for_linux: bool = sys.platform == "linux"

    def line(self, flags: tuple[str, ...], architecture: str | None, source: str, library: str) -> list[str]:
        """The command line that compiles a source to a library for a processor's architecture."""
        further = ["-Wl,--build-id=none"] if self.for_linux else []
        if architecture is not None:
            spelt = architecture.replace("-", "_") if self.is_ziglang else architecture
            further.append(f"-march={spelt}")
        return [*self.command, *flags, *further, source, "-o", library, "-lm"]


def platform_asked() -> Platform | None:
    """The platform that a wheel is asked for; None where it is for the machine that builds it.

    Raises
    ------
    CompilerError
        For a name that is none of ``PLATFORMS``.
    """
    name = os.environ.get(PLATFORM_VARIABLE)
    if name and name not in PLATFORMS:
        raise CompilerError(f"{PLATFORM_VARIABLE} is {name!r}; it may be {', '.join(PLATFORMS)}")
    return PLATFORMS[name] if name else None


def choose(flags: tuple[str, ...], architectures: list[str | None]) -> Compiler:
    """The machine's compiler (``CC``, or cc, gcc, clang) if it works with some flags, or else that of ``ziglang``.

    ``CC=ziglang`` asks for the package where there is a compiler, too.

    Raises
    ------
    CompilerError
        Where neither is there.
    """
    asked = "ziglang" if platform_asked() else os.environ.get("CC", "").strip()
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
    """The package's compiler: for the platform asked for, or else this system, on Linux with the oldest glibc."""
    command = (sys.executable, "-m", "ziglang", "cc")
    wanted = platform_asked() or PLATFORMS.get(f"{sys.platform}-{platform.machine()}")
    if wanted is None:
        return Compiler(command, is_ziglang=True)
    return Compiler((*command, "-target", wanted.target), wanted.wheel, True, "linux" in wanted.target)
