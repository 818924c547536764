"""The compiled loops of ``paper.h``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.kernel.library import load

ffi, lib = load(Path(__file__).with_name("paper.h"), "paper")

COMPILER: str = ffi.string(lib.paper_compiler()).decode()
"""What compiled them: name and version."""


def rows(array: NDArray[Any], kind: str = "double") -> Any:
    """An array, C-contiguous, as C sees it: a pointer that keeps it alive.

    ``kind`` is what an entry is, or a structure of doubles that a row is.
    """
    return ffi.from_buffer(f"{kind}[]", array)


def flags(array: NDArray[np.bool_]) -> Any:
    """An array of truth values as C sees it."""
    return rows(array, "uint8_t")
