"""The processor that machine code of modes is compiled for.

It is this machine's processor with its features, unless the variable ``HENON_REF_CPU`` names another: that processor's
own features then, as in LLVM. (``x86-64`` takes the kernel's library for processors without fused operations, too.)

Whatever the target, the reference's digits are the same. The optimiser has no licence to fuse, reorder or approximate
(no ``fastmath``, no flags in our own LLVM IR): fused operations are said (``fma``, which a processor without them
leaves to the C library), sums are written in the order, or the independent parts, in which they are added, and what is
vectorised is so lane by lane. What cannot be had is another C library: of the functions that it computes (exponential,
logarithm, power, tangent, the inverse and hyperbolic functions, and the sines of states beyond 1e15) glibc has one
version for processors with FMA and AVX2 and one for those without, others again from release to release, and other
systems have their own. They, and Python's ``math``, call that one library; NumPy's own, which depend on the processor,
decide nothing.
"""

from __future__ import annotations

import os
from typing import NamedTuple

import llvmlite.binding as llvm

from henon_ref.kernel.library import CPU_VARIABLE


class Target(NamedTuple):
    """What LLVM's code generator is told."""

    processor: str
    """LLVM's name of it, such as ``haswell``."""
    features: str
    """Features beyond or below those of the processor, such as ``+avx2,-avx512f``; empty: the processor's own."""


def target() -> Target:
    """Processor and features that code is compiled for in this process."""
    named = os.environ.get(CPU_VARIABLE)
    if named:
        return Target(named, "")
    return Target(llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())
