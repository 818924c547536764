"""The processor that machine code is compiled for: one place says it, for numba and for our own LLVM modules.

It is this machine's processor with its features, unless numba's variables ``NUMBA_CPU_NAME`` and ``NUMBA_CPU_FEATURES``
name another. A name alone means that processor's own features, as in LLVM (numba would keep this machine's).
"""

from __future__ import annotations

from typing import NamedTuple

import llvmlite.binding as llvm
from numba.core import config


class Target(NamedTuple):
    """What LLVM's code generator is told."""

    processor: str
    """LLVM's name of it, such as ``haswell``."""
    features: str
    """Features beyond or below those of the processor, such as ``+avx2,-avx512f``; empty: the processor's own."""


def target() -> Target:
    """Processor and features that code is compiled for in this process."""
    if config.CPU_NAME is None:
        return Target(llvm.get_host_cpu_name(), config.CPU_FEATURES or llvm.get_host_cpu_features().flatten())
    return Target(config.CPU_NAME, config.CPU_FEATURES or "")


def _tell_numba() -> None:
    """Make numba use :func:`target`, too: of a name alone it would keep this machine's features."""
    config.CPU_NAME, config.CPU_FEATURES = target()


_tell_numba()
