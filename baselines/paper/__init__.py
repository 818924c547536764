"""Programs of Olejnik and Awrejcewicz (2013): the method of the paper, implemented correctly (``henon-rk4``), and the
appendix as printed (``henon-listing``).

The loops are C: ``paper.h`` declares the functions.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from henon_ref.kernel.library import load

ffi, lib = load(Path(__file__).with_name("paper.h"), "paper")

COMPILER: str = ffi.string(lib.paper_compiler()).decode()
"""Name and version of the C compiler."""


def rows(array: NDArray[Any], kind: str = "double") -> Any:
    """Return a C pointer to a C-contiguous array; the pointer keeps the array alive.

    ``kind`` is the C type of an entry, or a structure of doubles that is the type of a row.
    """
    return ffi.from_buffer(f"{kind}[]", array)
