"""The kernel's library, and what it shares with Python: record types and levels, all of them from ``kernel.h``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.kernel.library import load

ffi, kernel = load(Path(__file__).with_name("kernel.h"), "kernel")
"""What knows the header's types, and the library: its functions, and the numbers with names of its enumerations."""
LEVELS = kernel.levels()
"""Bounds and levels of compiled code (``struct levels``)."""
EPS: float = LEVELS.eps
"""Distance from 1 to the next double."""
_FORMATS = {"double": "f8", "int64_t": "i8", "int32_t": "i4", "int16_t": "i2", "int8_t": "i1"}


def record_dtype(structure: str) -> np.dtype[Any]:
    """NumPy's type of a structure of the header: its fields but for a flexible array at the end; pointers are integers.

    Parameters
    ----------
    structure : str
        Its name, without the word ``struct``.
    """
    kind = ffi.typeof(f"struct {structure}")
    fields = [(name, field) for name, field in kind.fields if field.type.kind != "array"]
    return np.dtype(
        {
            "names": [name for name, _ in fields],
            "formats": [_FORMATS.get(field.type.cname, "i8") for _, field in fields],
            "offsets": [field.offset for _, field in fields],
            "itemsize": ffi.sizeof(kind),
        },
        align=True,
    )


def doubles(array: NDArray[Any]) -> Any:
    """The doubles of a C-contiguous array as C sees them; they are the array's as long as this is kept."""
    return ffi.from_buffer("double[]", array)


def integers(array: NDArray[np.int64]) -> Any:
    """The same for integers."""
    return ffi.from_buffer("int64_t[]", array)
