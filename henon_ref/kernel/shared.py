"""Library of the kernel, and the record types and levels that it shares with Python, all from ``kernel.h``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.kernel.library import load

ffi, kernel = load(Path(__file__).with_name("kernel.h"), "kernel")
"""Interface with the types of the header, and the library with its functions and enumeration constants."""
LEVELS = kernel.levels()
"""Bounds and levels of compiled code (``struct levels``)."""
EPS: float = LEVELS.eps
"""Distance from 1 to the next double."""


def record_dtype(structure: str) -> np.dtype[Any]:
    """NumPy type of a structure of the header, without the flexible array at its end; pointers are integers.

    Parameters
    ----------
    structure : str
        Name of the structure, without the word ``struct``.
    """
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
