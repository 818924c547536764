"""Loading of a C source's library through cffi, with checks of its processor, sources and arithmetic.

Nothing is compiled here: a missing or stale library raises an error that names the command to build it. The kernel's
library is loaded with this module; the record types and levels that it shares with Python are all from ``kernel.h``.
"""

from __future__ import annotations

import os
import platform
import re
import sys
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from cffi import FFI
from numpy.typing import NDArray

from henon_ref.errors import KernelError
from henon_ref.kernel.compilation import best, library_file, source_files, sources_hash

CPU_VARIABLE = "HENON_REF_CPU"
"""Environment variable: LLVM's name of the processor for which machine code of modes is compiled. ``x86-64`` also
selects the library for processors without fused operations."""
SELF_TEST = float.fromhex("-0x1.d23ef345ec270p-2")
"""Correct return value of ``henon_self_test`` (``self_test.h``)."""


def load(header: Path, name: str) -> tuple[FFI, Any]:
    """Load the library that was compiled from ``NAME.c`` in the folder of a header with its exported declarations.

    Returns the interface with the types of the header, and the library with its functions as attributes; a call
    releases the interpreter lock. KernelError if the library is missing, or was compiled from other sources or with
    other arithmetic.
    """
    source = header.with_name(f"{name}.c")
    file = library_file(source, best(processor_features()))
    if not file.exists():
        raise KernelError(f"{file} is missing: {_remedy()}")
    ffi = FFI()
    # What every library exports (self_test.h), in addition to the header.
    ffi.cdef("extern const char henon_sources[]; double henon_self_test(void);" + declarations(header))
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
    """Features of this processor, with LLVM's names; none if ``HENON_REF_CPU`` is ``x86-64``."""
    baseline = os.environ.get(CPU_VARIABLE) == "x86-64"
    if baseline or platform.machine().lower() not in ("x86_64", "amd64"):
        return frozenset()
    return frozenset(name for name, here in llvm.get_host_cpu_features().items() if here)


def declarations(header: Path) -> str:
    """Text of a header and of the headers that it includes in quotes, in the form that cffi reads.

    The only directives kept are ``#define NAME INTEGER``; ``HENON_EXPORT`` is removed.
    """
    text = b"\n".join(source_files(header).values()).decode()
    text = re.sub(r"/\*.*?\*/", " ", text, flags=re.DOTALL).replace("\\\n", " ")
    directive = re.compile(r"^[ \t]*#(?![ \t]*define[ \t]+\w+[ \t]+(?:0[xX][0-9a-fA-F]+|\d+)[ \t]*$).*$", re.MULTILINE)
    return re.sub(r"\bHENON_EXPORT\b", "", directive.sub("", text))


def _remedy() -> str:
    """Command that rebuilds the libraries, in a clone or for an installed wheel."""
    root = Path(__file__).resolve().parents[2]
    if (root / "build_backend").is_dir():
        return f"cd {root} && {sys.executable} -m build_backend"
    return "pip install --force-reinstall --no-deps henon-ref"


ffi, kernel = load(Path(__file__).with_name("kernel.h"), "kernel")
"""Interface with the types of the header, and the library with its functions and enumeration constants."""
LEVELS = kernel.levels()
"""Bounds and levels of compiled code (``struct levels``)."""
EPS: float = LEVELS.eps
"""Distance from 1 to the next double."""


def record_dtype(structure: str) -> np.dtype[Any]:
    """NumPy type of a ``struct`` of the header, without the flexible array at its end; pointers are integers."""
    kind = ffi.typeof(f"struct {structure}")
    formats = {"double": "f8", "int32_t": "i4", "int16_t": "i2", "int8_t": "i1"}
    fields = [(name, field) for name, field in kind.fields if field.type.kind != "array"]
    return np.dtype(
        {
            "names": [name for name, _ in fields],
            "formats": [formats.get(field.type.cname, "i8") for _, field in fields],
            "offsets": [field.offset for _, field in fields],
            "itemsize": ffi.sizeof(kind),
        },
        align=True,
    )


def doubles(array: NDArray[Any]) -> Any:
    """Buffer of a C-contiguous array's doubles for C; it keeps the array alive."""
    return ffi.from_buffer("double[]", array)


def integers(array: NDArray[np.int64]) -> Any:
    """Buffer of a C-contiguous array's integers for C; it keeps the array alive."""
    return ffi.from_buffer("int64_t[]", array)
