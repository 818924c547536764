"""Compilation of a C library: source files, flags, variants for processors, and the hash of the sources.

The build loads this file before anything is installed (``build_backend/libraries.py``), so that it imports only the
standard library.
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
    # No debugging information, which has paths of the build machine: the same sources give the same bytes anywhere.
    "-g0",
    # Fused operations are explicit (__builtin_fma): if the compiler fuses freely, a quarter of all results differ.
    "-ffp-contract=off",
    "-fPIC",
    "-shared",
    # Exported functions are marked; all others can be inlined and called directly.
    "-fvisibility=hidden",
    # Call functions of the C library by their address, without a stub that looks it up.
    "-fno-plt",
)
"""Flags of every library. No flag allows reordering, fusing or approximation, or names a processor."""


class Variant(NamedTuple):
    """Variant of a library for a class of processors."""

    name: str
    architecture: str | None
    """Value of ``-march``; None: the compiler's default."""
    features: frozenset[str]
    """Features that a processor needs to run the library, with LLVM's names."""


X86_64 = (
    Variant("x86-64-v3", "x86-64-v3", frozenset({"avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"})),
    # Each fused operation calls the C library: a run takes 1.2 to 1.3 times as long, with the same bits.
    Variant("x86-64", "x86-64", frozenset()),
)
"""Variants, the best first. None is specific to the build machine, because other machines run the libraries, too."""


def variants(machine: str | None = None) -> tuple[Variant, ...]:
    """Variants of a library for a kind of machine, by default this one."""  # every ARM processor can fuse
    machine = (machine or platform.machine()).lower()
    return X86_64 if machine in ("x86_64", "amd64") else (Variant(machine, None, frozenset()),)


def best(features: Set[str]) -> Variant:
    """Best variant for a processor with given features."""
    return next(variant for variant in variants() if variant.features <= features)


def library_file(source: Path, variant: Variant) -> Path:
    """Path of a source's library, in the same folder."""
    return source.with_name(f"_{source.stem}.{variant.name}.so")


def source_files(source: Path) -> dict[Path, bytes]:
    """Contents of a C file and of all files that it includes in quotes, each once, included files first."""
    found: dict[Path, bytes] = {}
    begun: set[str] = set()

    def read(path: str) -> None:
        if path in begun:
            return
        begun.add(path)
        content = Path(path).read_bytes()
        # A newline in place of ^ makes the search quick: 0.2 ms instead of 12 ms.
        for name in re.findall(rb'\n[ \t]*#[ \t]*include[ \t]*"([^"]+)"', b"\n" + content):
            folder = os.path.dirname(path)
            if not os.path.isfile(os.path.join(folder, name.decode())):
                folder = os.path.join(folder, os.pardir)  # an installation has the baselines a folder deeper
            read(os.path.normpath(os.path.join(folder, name.decode())))
        found[Path(path)] = content

    read(os.path.normpath(source.absolute()))
    return found


def sources_hash(source: Path, machine: str | None = None) -> str:
    """SHA-256 of the flags for a kind of machine, a C file, and all files that it includes in quotes."""
    flags = " ".join((*FLAGS, *(str(variant.architecture) for variant in variants(machine))))
    parts = [flags.encode(), *source_files(source).values()]
    return hashlib.sha256(b"\0".join(parts)).hexdigest()
