"""Processor for which machine code of modes is compiled.

It is this machine's processor with its features, unless the variable ``HENON_REF_CPU`` names a processor: then LLVM's
features of that processor. (``x86-64`` also selects the kernel's library for processors without fused operations.)

The digits of the reference do not depend on the target. The optimiser may not fuse, reorder or approximate (no
``fastmath``, no flags in our LLVM IR). Fused operations are explicit (``fma``, done by the C library on processors
without it), sums keep their written order or independent parts, and vector code works lane by lane. The digits do
depend on the C library, for the functions that it computes (exponential, logarithm, power, tangent, the inverse and
hyperbolic functions, and the sines of states beyond 1e15). glibc has different versions for processors with and without
FMA and AVX2, versions change between releases, and other systems have their own library. Modes and Python's ``math``
call this one library; NumPy's functions, which depend on the processor, decide nothing.
"""

from __future__ import annotations

import os
from typing import NamedTuple

import llvmlite.binding as llvm

from henon_ref.kernel.library import CPU_VARIABLE


class Target(NamedTuple):
    """Arguments of LLVM's code generator."""

    processor: str
    """LLVM's name of the processor, such as ``haswell``."""
    features: str
    """Features added to or removed from the processor's, such as ``+avx2,-avx512f``; empty: the processor's own."""


def target() -> Target:
    """Processor and features for which this process compiles."""
    named = os.environ.get(CPU_VARIABLE)
    if named:
        return Target(named, "")
    return Target(llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())
