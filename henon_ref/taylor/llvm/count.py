"""Count of floating-point operations in LLVM code."""

from __future__ import annotations

import re


def count(ir: str) -> int:
    """Count floating-point operations in LLVM IR: each lane of a vector counts, a fused multiply-add counts twice."""
    total = 0
    for line in ir.splitlines():
        if not re.search(r"\b(fadd|fsub|fmul|fdiv)\b|llvm\.fma", line) or line.startswith("declare"):
            continue
        lanes = re.search(r"<(\d+) x double>", line)
        total += (2 if "llvm.fma" in line else 1) * (int(lanes[1]) if lanes else 1)
    return total
