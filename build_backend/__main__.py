"""Compile the libraries anew, in place: ``python -m build_backend [FLAG ...]``, with further flags of the compiler."""

from __future__ import annotations

import sys

from build_backend.compilers import CompilerError
from build_backend.libraries import compile_all, library_files

try:
    compile_all(extra=tuple(sys.argv[1:]))
except CompilerError as error:
    sys.exit(f"error: {error}")
print(*library_files(), sep="\n")
