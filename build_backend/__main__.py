"""Compile the libraries anew, in place: ``python -m build_backend [FLAG ...]``, further flags of the compiler last."""

from __future__ import annotations

import sys

from build_backend.compilers import CompilerError
from build_backend.libraries import ROOT, compile_all

try:
    for file in compile_all(extra=tuple(sys.argv[1:])):
        print(file.relative_to(ROOT))
except CompilerError as error:
    sys.exit(f"error: {error}")
