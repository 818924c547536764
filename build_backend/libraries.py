"""The C sources of this project, compiled to libraries."""

from __future__ import annotations

import os
import runpy
import shlex
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

from build_backend.compilers import Compiler, CompilerError, choose

ROOT = Path(__file__).parents[1]
SOURCES = ("henon_ref/kernel/kernel.c", "baselines/paper/paper.c")
"""One translation unit each, that includes all it is made of."""
_RECIPE: dict[str, Any] = runpy.run_path(str(ROOT / "henon_ref/kernel/compilation.py"))
FLAGS: tuple[str, ...] = _RECIPE["FLAGS"]
_VARIANTS: tuple[Any, ...] = _RECIPE["variants"]()
_JOBS = list(product(SOURCES, _VARIANTS))


@cache
def compiler() -> Compiler:
    """The compiler that builds here."""
    return choose(FLAGS, [variant.architecture for variant in _VARIANTS])


def library_files() -> list[Path]:
    """The libraries, relative to the tree's root."""
    return [_RECIPE["library_file"](Path(source), variant) for source, variant in _JOBS]


def compile_all(into: Path = ROOT, *, root: Path = ROOT, extra: tuple[str, ...] = ()) -> list[Path]:
    """Compile every source for every kind of processor.

    Parameters
    ----------
    into : Path
        Folder that stands for the tree's root: a library lies in it as its source in the tree.
    root : Path
        The tree.
    extra : tuple of str
        Further flags of the compiler, behind those of every library.

    Returns
    -------
    list of Path
        The libraries.

    Raises
    ------
    CompilerError
        Where there is no compiler, or it does not compile one of them.
    """
    chosen = compiler()
    with tempfile.TemporaryDirectory() as caches, ThreadPoolExecutor(os.cpu_count()) as pool:
        environment = os.environ | {"ZIG_LOCAL_CACHE_DIR": caches, "ZIG_GLOBAL_CACHE_DIR": caches}
        return list(pool.map(lambda job: _library(chosen, *job, into, root, extra, environment), _JOBS))


def _library(
    chosen: Compiler, source: str, variant: Any, into: Path, root: Path, extra: tuple[str, ...], environment: Any
) -> Path:
    """Compile a source for a kind of processor; what was there is replaced at once, for programs that run it."""
    file: Path = _RECIPE["library_file"](into / source, variant)
    file.parent.mkdir(parents=True, exist_ok=True)
    new = file.with_name(f"{file.name}.{os.getpid()}")
    sources_hash = _RECIPE["sources_hash"](root / source)
    flags = (*FLAGS, f'-DHENON_SOURCES="{sources_hash}"', *extra)
    line = chosen.line(flags, variant.architecture, source, str(new))
    done = subprocess.run(line, cwd=root, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        new.unlink(missing_ok=True)
        raise CompilerError(f"{source} does not compile:\n{shlex.join(line)}\n{done.stderr}")
    new.chmod(0o644)
    new.replace(file)
    return file
