"""Of what a C library is compiled and how: source files, flags, processors, their hash.

The build reads this file by itself, before anything is installed (``build_backend/libraries.py``): nothing but the
standard library is imported here.
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
from collections.abc import Set
from pathlib import Path
from typing import NamedTuple

FLAGS = (
    "-std=c11",
    "-O3",
    # No places of source files on the machine that builds: the same sources give the same bytes anywhere.
    "-g0",
    # Fused operations are said (__builtin_fma): where a compiler fuses at will, a quarter of all results differ.
    "-ffp-contract=off",
    "-fPIC",
    "-shared",
    # What is exported is marked; all else can be inlined and calls its like directly.
    "-fvisibility=hidden",
    # Functions of the C library are called by their address, not through a stub that looks it up.
    "-fno-plt",
)
"""Flags of every library. None gives licence to reorder, fuse or approximate, and no processor is named here."""


class Variant(NamedTuple):
    """One of the libraries that a source is compiled to."""

    name: str
    architecture: str | None
    """Value of ``-march``; None: what the compiler takes by itself."""
    features: frozenset[str]
    """What a processor must have to run it, in LLVM's words."""


X86_64 = (
    Variant("x86-64-v3", "x86-64-v3", frozenset({"avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"})),
    # Each fused operation is a call of the C library here: a run takes 1.2 to 1.3 times as long, with the same bits.
    Variant("x86-64", "x86-64", frozenset()),
)
"""The best first. Never the processor of the machine that builds: others run what it built."""
_INCLUDE = re.compile(rb'\n[ \t]*#[ \t]*include[ \t]*"([^"]+)"')
"""It begins with a letter, not with ``^``, which is tried at every letter: 0.2 in place of 12 ms for the kernel."""


def variants(machine: str | None = None) -> tuple[Variant, ...]:
    """The libraries that a source is compiled to for a kind of machine, by default this one."""  # ARM fuses anywhere
    machine = (machine or platform.machine()).lower()
    return X86_64 if machine in ("x86_64", "amd64") else (Variant(machine, None, frozenset()),)


def best(features: Set[str]) -> Variant:
    """The variant for a processor with some features."""
    return next(variant for variant in variants() if variant.features <= features)


def library_file(source: Path, variant: Variant) -> Path:
    """Where the library of a source lies: beside it."""
    return source.with_name(f"_{source.stem}.{variant.name}.so")


def source_files(source: Path) -> dict[Path, bytes]:
    """A C file and all that it includes in quotes, each once: what is included stands before what includes it."""
    found: dict[Path, bytes] = {}
    begun: set[str] = set()

    def read(path: str) -> None:
        if path in begun:
            return
        begun.add(path)
        content = Path(path).read_bytes()
        for name in _INCLUDE.findall(b"\n" + content):
            folder = os.path.dirname(path)
            if not os.path.isfile(os.path.join(folder, name.decode())):
                folder = os.path.join(folder, os.pardir)  # an installation has the baselines a folder deeper
            read(os.path.normpath(os.path.join(folder, name.decode())))
        found[Path(path)] = content

    read(os.path.normpath(source.absolute()))
    return found


def sources_hash(source: Path, machine: str | None = None) -> str:
    """SHA-256 over a C file, all that it includes in quotes, and the flags for a kind of machine."""
    flags = " ".join((*FLAGS, *(str(variant.architecture) for variant in variants(machine))))
    parts = [flags.encode(), *source_files(source).values()]
    return hashlib.sha256(b"\0".join(parts)).hexdigest()
