"""The C sources of this project, compiled to libraries."""

from __future__ import annotations

import os
import platform
import runpy
import shlex
import subprocess
import tempfile
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

from build_backend.compilers import Compiler, CompilerError, choose, platform_asked

ROOT = Path(__file__).parents[1]
SOURCES = ("henon_ref/kernel/kernel.c", "baselines/paper/paper.c")
"""One translation unit each, that includes all it is made of."""
INSIDE = ("baselines", "cases")
"""Folders of the tree that an installation has inside ``henon_ref``."""
_RECIPE: dict[str, Any] = runpy.run_path(str(ROOT / "henon_ref/kernel/compilation.py"))
"""Flags, processors and hash, which the loader needs, too; by path: the package itself cannot be imported yet."""
FLAGS: tuple[str, ...] = _RECIPE["FLAGS"]


@cache
def compiler() -> Compiler:
    """The compiler that builds here."""
    return choose(FLAGS, [variant.architecture for variant in _RECIPE["variants"](_machine())])


def _machine() -> str:
    """The kind of machine that the libraries are for."""
    wanted = platform_asked()
    return wanted.machine if wanted else platform.machine()


def _libraries() -> list[tuple[str, Any]]:
    """Each source with each variant that it is compiled to."""
    return list(product(SOURCES, _RECIPE["variants"](_machine())))


def library_files() -> list[Path]:
    """The libraries, relative to the tree's root."""
    return [_RECIPE["library_file"](Path(source), variant) for source, variant in _libraries()]


def installed(path: str | Path) -> Path:
    """Where an installation has a file of the tree, both relative to their roots."""
    return Path("henon_ref", path) if Path(path).parts[0] in INSIDE else Path(path)


def compile_all(into: Path = ROOT, *, root: Path = ROOT, extra: tuple[str, ...] = ()) -> None:
    """Compile every source for every kind of processor.

    Parameters
    ----------
    into : Path
        The tree's root, where each library lies beside its source, or a folder that is laid out as an installation.
    root : Path
        The tree's root.
    extra : tuple of str
        Further flags of the compiler.

    Raises
    ------
    CompilerError
        Where there is no compiler, or it does not compile one of them.
    """
    chosen = compiler()
    with tempfile.TemporaryDirectory() as caches, ThreadPoolExecutor(os.cpu_count()) as pool:
        environment = {"ZIG_LOCAL_CACHE_DIR": caches, "ZIG_GLOBAL_CACHE_DIR": caches} | os.environ

        def compile_one(library: tuple[str, Any]) -> None:
            source, variant = library
            given = f'-DHENON_SOURCES="{_RECIPE["sources_hash"](root / source, _machine())}"'
            file = _RECIPE["library_file"](into / (source if into == root else installed(source)), variant)
            _compile(chosen, (*FLAGS, given, *extra), variant.architecture, root, source, file, environment)

        list(pool.map(compile_one, _libraries()))


def _compile(
    chosen: Compiler,
    flags: tuple[str, ...],
    architecture: str | None,
    root: Path,
    source: str,
    file: Path,
    environment: Mapping[str, str],
) -> None:
    """Compile one library; a process that runs the one that was there goes on with it.

    It is linked in a folder of its own: for Windows a linker leaves an import library and debugging information beside
    it, and writes the file's name into it.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=file.parent) as folder:
        new = Path(folder, file.name).absolute()
        line = chosen.line(flags, architecture, source, str(new))
        done = subprocess.run(line, cwd=root, env=environment, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise CompilerError(f"{source} does not compile:\n{shlex.join(line)}\n{done.stderr}")
        new.chmod(0o644)
        new.replace(file)
