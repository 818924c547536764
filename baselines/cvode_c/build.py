"""The C program for one problem, compiled where a compiler and SUNDIALS are, and kept in the cache.

The key is the text of all that goes into it: program, equations, compiler, options, and the version of the library.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
from functools import cache
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory

from henon_ref.errors import UnavailableError
from henon_ref.jit.cache_folder import cache_root
from henon_ref.text import short_line

SOURCES = ("cvode.c", "json.h", "response.h")
EQUATIONS = "problem.h"
OPTIONS = ("-O2", "-std=gnu11", "-ffp-contract=off", "-fno-math-errno")
LIBRARIES = ("sundials_cvode", "sundials_nvecserial", "m")
COMPILERS = ("cc", "gcc", "clang")
VARIABLE = "CC"
"""Environment variable that names the compiler, as elsewhere."""
PREFIX = "SUNDIALS_PREFIX"
"""Environment variable of the folder with SUNDIALS' ``include`` and ``lib``, where it is not the system's own."""
WANTED = 6
"""Major version of SUNDIALS that the program is written for."""
FOLDER = "programs"
"""Folder in the cache."""
SECONDS = 60.0
"""Wall time that compiling may take [s]."""
PACKAGES = "Debian: gcc and libsundials-dev"
_CONFIG = "sundials/sundials_config.h"
_VERSION = re.compile(r'#define\s+SUNDIALS_VERSION\s+"([^"]+)"')


def include_folder() -> Path | None:
    """Where the library's headers are; None where there are none."""
    prefix = os.environ.get(PREFIX)
    for folder in (Path(prefix),) if prefix else (Path("/usr"), Path("/usr/local")):
        if (folder / "include" / _CONFIG).is_file():
            return folder / "include"
    return None


def library_version() -> str:
    """Version of SUNDIALS' headers, empty where there are none."""
    folder = include_folder()
    if folder is None:
        return ""
    found = _VERSION.search((folder / _CONFIG).read_text(encoding="utf-8", errors="replace"))
    return found[1] if found else ""


def compiler() -> str:
    """The C compiler, empty where there is none."""
    wanted = os.environ.get(VARIABLE)
    return next((path for name in ((wanted,) if wanted else COMPILERS) if (path := shutil.which(name))), "")


def tools() -> tuple[str, Path]:
    """Compiler and folder of headers.

    Raises
    ------
    UnavailableError
        Where one of them is missing.
    """
    found, folder, version = compiler(), include_folder(), library_version()
    if not found:
        raise UnavailableError(f"there is no C compiler ({PACKAGES})")
    if folder is None:
        raise UnavailableError(f"SUNDIALS' headers are not installed ({PACKAGES})")
    if version.partition(".")[0] != str(WANTED):
        raise UnavailableError(f"SUNDIALS is version {version or 'unknown'}, wanted {WANTED}.x")
    return found, folder


def program_for(equations: str) -> Path:
    """The compiled program with these equations.

    Raises
    ------
    UnavailableError
        Where it cannot be compiled here.
    """
    found, folder = tools()
    texts = {name: files("henon_ref.baselines.cvode_c").joinpath(name).read_text(encoding="utf-8") for name in SOURCES}
    texts[EQUATIONS] = equations
    key = hashlib.sha256(repr((texts, found, _compiler_version(found), OPTIONS, library_version())).encode())
    place = cache_root() / FOLDER
    program = place / f"cvode-{key.hexdigest()[:32]}"
    if not program.is_file():
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        _compile(found, folder, texts, program)
    return program


@cache
def _compiler_version(path: str) -> str:
    done = subprocess.run([path, "--version"], capture_output=True, text=True, timeout=SECONDS, check=False)
    return done.stdout.partition("\n")[0]


def _compile(compiler_path: str, include: Path, texts: dict[str, str], program: Path) -> None:
    """Compile into place, whole or not at all."""
    library = include.parent / "lib"
    with TemporaryDirectory(dir=program.parent) as folder:
        for name, text in texts.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        made = Path(folder) / "program"
        command = [compiler_path, *OPTIONS, f"-I{include}", SOURCES[0], "-o", made.name, f"-L{library}"]
        command += [f"-Wl,-rpath,{library}"] if os.environ.get(PREFIX) else []
        command += [f"-l{name}" for name in LIBRARIES]
        try:
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=SECONDS, check=False)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise UnavailableError(short_line(f"{compiler_path} does not compile the program: {error}")) from error
        if done.returncode != 0:
            raise UnavailableError(short_line(f"{compiler_path} does not compile the program: {done.stderr}"))
        made.replace(program)
