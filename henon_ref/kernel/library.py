"""The library of a C source, called through cffi: for this processor, made of these sources, with their arithmetic.

Nothing is compiled here: what is missing or stale is an error that names the line which builds it anew.
"""

from __future__ import annotations

import os
import platform
import re
import sys
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
from cffi import FFI

from henon_ref.errors import KernelError
from henon_ref.kernel.compilation import best, library_file, source_files, sources_hash

CPU_VARIABLE = "HENON_REF_CPU"
"""Environment variable: LLVM's name of the processor that machine code of modes is compiled for; with ``x86-64`` the
library is that for processors without fused operations."""
SELF_TEST = float.fromhex("-0x1.d23ef345ec270p-2")
"""What ``henon_self_test`` of ``self_test.h`` returns."""
EXPORTED = "extern const char henon_sources[]; double henon_self_test(void);"
"""What every library exports (``self_test.h``)."""


def load(header: Path, name: str) -> tuple[FFI, Any]:
    """Load the library that was compiled from ``NAME.c`` beside a header.

    Parameters
    ----------
    header : Path
        What the library exports, for :func:`declarations`.
    name : str
        The C source's name without its ending.

    Returns
    -------
    ffi : cffi.FFI
        It knows the header's types.
    lib
        The library, with its functions as attributes; a call releases the interpreter lock.

    Raises
    ------
    KernelError
        Where there is no library, or it was compiled from other sources or with other arithmetic.
    """
    source = header.with_name(f"{name}.c")
    file = library_file(source, best(processor_features()))
    if not file.exists():
        raise KernelError(f"{file} is missing: {_remedy()}")
    ffi = FFI()
    ffi.cdef(EXPORTED + declarations(header))
    lib = ffi.dlopen(str(file))
    if ffi.string(lib.henon_sources).decode() != sources_hash(source):
        raise KernelError(f"{file} was compiled from other sources than those beside it: {_remedy()}")
    found = lib.henon_self_test()
    if found != SELF_TEST:
        raise KernelError(
            f"{file} was compiled with other arithmetic than its sources say (operations fused, reordered or "
            f"approximated: its self-test gives {found.hex()} in place of {SELF_TEST.hex()}): {_remedy()}"
        )
    return ffi, lib


def processor_features() -> frozenset[str]:
    """Features of this machine's processor in LLVM's words; of none where ``HENON_REF_CPU`` asks for the baseline."""
    baseline = os.environ.get(CPU_VARIABLE) == "x86-64"
    if baseline or platform.machine().lower() not in ("x86_64", "amd64"):
        return frozenset()
    return frozenset(name for name, here in llvm.get_host_cpu_features().items() if here)


def declarations(header: Path) -> str:
    """A header, with those that it includes in quotes, as cffi reads it.

    Of the preprocessor's lines only ``#define NAME INTEGER`` is kept; ``HENON_EXPORT`` is dropped.
    """
    text = b"\n".join(source_files(header).values()).decode()
    text = re.sub(r"/\*.*?\*/", " ", text, flags=re.DOTALL).replace("\\\n", " ")
    directive = re.compile(r"^[ \t]*#(?![ \t]*define[ \t]+\w+[ \t]+(?:0[xX][0-9a-fA-F]+|\d+)[ \t]*$).*$", re.MULTILINE)
    return re.sub(r"\bHENON_EXPORT\b", "", directive.sub("", text))


def _remedy() -> str:
    """The line that makes the libraries anew: in a clone, or where a wheel was installed."""
    root = Path(__file__).resolve().parents[2]
    if (root / "build_backend").is_dir():
        return f"cd {root} && {sys.executable} -m build_backend"
    return "pip install --force-reinstall --no-deps henon-ref"
