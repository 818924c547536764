"""Compile the libraries anew, in place: ``python -m build_backend [FLAG ...]``, further flags of the compiler last."""

from __future__ import annotations

import sys

from build_backend.compilers import CompilerError
from build_backend.libraries import ROOT, build

try:
    for file in build(extra=tuple(sys.argv[1:])):
        print(file.relative_to(ROOT))
except CompilerError as error:
    sys.exit(f"error: {error}")
