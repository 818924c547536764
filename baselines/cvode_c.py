"""``cvode-c-adams`` and ``cvode-c-bdf``: SUNDIALS' CVODE with its own rootfinding, called from C.

Both solve their implicit steps by Newton's iteration with a dense Jacobian, as the adapters by scikit-sundae do. For
Adams, Newton's iteration is the faster of SUNDIALS' two options (``cvode.c`` has the measurement). Right-hand sides,
Jacobians and guards are C code made from the text of a request and compiled once per system. Every event is followed
by ``CVodeReInit``.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from henon_ref.baselines.protocol.exchange import command_output
from henon_ref.baselines.protocol.messages import Guard, Mode, Problem
from henon_ref.baselines.protocol.problem_text import renamed
from henon_ref.baselines.protocol.program import ProgramSolver
from henon_ref.errors import UnavailableError
from henon_ref.jit.cache_folder import cache_root
from henon_ref.text import short_line

FLAGS = ("-O2", "-std=gnu11", "-ffp-contract=off", "-fno-math-errno")
VARIABLE = "CC"
"""Environment variable that names the compiler."""
PREFIX = "SUNDIALS_PREFIX"
"""Environment variable for the folder of SUNDIALS' ``include`` and ``lib``, if they are not those of the system."""
_CONFIG = "sundials/sundials_config.h"
ARGUMENTS = "double t, const double *x, const double *p"
HEAD = """/* Made by henon_ref from the text of a request. */
#pragma once
#include <math.h>

enum {{ STATES = {states}, PARAMETERS = {parameters}, MODE_COUNT = {modes}, MOST_GUARDS = {guards} }};
enum {{ NONUNIQUE = 2, INVALID = 3, NONE = 4 }};
typedef enum {{ SURFACE, RELEASE, VALID }} Kind;
typedef void Function(double, const double *, const double *, double *);

typedef struct {{
    int mode, unknowns, guards;
    int surface_guard; /* index of the guard that is the surface; -1: none */
    int unarmed;       /* guards that may begin negative, one bit each */
    Kind kinds[MOST_GUARDS];
    Function *field, *jacobian, *values, *start;
    int (*successor)(int, double, const double *, const double *);
}} ModeTable;
"""


def include_folder() -> Path | None:
    """Folder of SUNDIALS' headers; None if they are not installed."""
    prefix = os.environ.get(PREFIX)
    for folder in (Path(prefix),) if prefix else (Path("/usr"), Path("/usr/local")):
        if (folder / "include" / _CONFIG).is_file():
            return folder / "include"
    return None


def library_version() -> str:
    """Version of SUNDIALS' headers; empty if they are not installed."""
    folder = include_folder()
    if folder is None:
        return ""
    header = (folder / _CONFIG).read_text(encoding="utf-8", errors="replace")
    found = re.search(r'#define\s+SUNDIALS_VERSION\s+"([^"]+)"', header)
    return found[1] if found else ""


def compiler() -> str:
    """Path of the C compiler; empty if there is none."""
    wanted = os.environ.get(VARIABLE)
    return next(filter(None, map(shutil.which, (wanted,) if wanted else ("cc", "gcc", "clang"))), "")


def tools() -> tuple[str, Path]:
    """Return the compiler and the folder of headers; raise :class:`UnavailableError` if one is missing."""
    found, folder, version = compiler(), include_folder(), library_version()
    packages = "Debian: gcc and libsundials-dev"
    if not found:
        raise UnavailableError(f"there is no C compiler ({packages})")
    if folder is None:
        raise UnavailableError(f"SUNDIALS' headers are not installed ({packages})")
    if version.partition(".")[0] != "6":
        raise UnavailableError(f"SUNDIALS is version {version or 'unknown'}, wanted 6.x")
    return found, folder


def program_for(equations: str) -> Path:
    """Return the compiled program with these equations, from the cache or compiled now.

    The key of the cache consists of the sources, the equations, the compiler and its options, and SUNDIALS' version.
    """
    path, _ = tools()
    folder = Path(__file__).with_name("programs")
    texts = {name: folder.joinpath(name).read_text(encoding="utf-8") for name in ("cvode.c", "json.h", "response.h")}
    texts["problem.h"] = equations
    key = hashlib.sha256(repr((texts, path, _compiler_version(path), FLAGS, library_version())).encode())
    place = cache_root() / "programs"
    program = place / f"cvode-{key.hexdigest()[:32]}"
    if not program.is_file():
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        compile_program(texts, program)
    return program


@cache
def _compiler_version(path: str) -> str:
    version = command_output(path, "--version")
    if version is None:
        raise UnavailableError(f"the compiler {path} does not tell its version")
    return version.partition("\n")[0]


def compile_program(texts: Mapping[str, str], program: Path) -> None:
    """Compile the first of some sources and headers (text by file name) with SUNDIALS; ``program`` is never incomplete.

    UnavailableError if a tool is missing, or the compiler fails.
    """
    path, include = tools()
    library = include.parent / "lib"
    with TemporaryDirectory(dir=program.parent) as folder:
        for name, text in texts.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        made = Path(folder) / "program"
        command = [path, *FLAGS, f"-I{include}", next(iter(texts)), "-o", made.name, f"-L{library}"]
        command += [f"-Wl,-rpath,{library}"] if os.environ.get(PREFIX) else []
        command += ["-lsundials_cvode", "-lsundials_nvecserial", "-lm"]
        try:
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60.0, check=False)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise UnavailableError(short_line(f"{path} does not compile the program: {error}")) from error
        if done.returncode != 0:
            raise UnavailableError(short_line(f"{path} does not compile the program: {done.stderr}"))
        made.replace(program)


def c_equations(problem: Problem) -> str:
    """Write the equations of a problem as the C header ``problem.h``.

    The header contains no parameter values and no numbers of the run, so that readings of a case that differ only in
    these share a program.
    """
    names = {name: f"x[{k}]" for k, name in enumerate(problem.states)}
    names |= {name: f"p[{k}]" for k, name in enumerate(problem.parameters)}
    head = HEAD.format(
        states=len(problem.states),
        parameters=len(problem.parameters),
        modes=len(problem.modes),
        guards=max(1, *(len(mode.guards) for mode in problem.modes)),
    )
    surface = [
        f"static double surface({ARGUMENTS})\n{{\n    (void)t, (void)x, (void)p;\n"
        f"    return {renamed(problem.surface.expression, names)};\n}}\n",
        _function("surface_gradient", problem.surface.gradient, names),
    ]
    modes = [part for k, mode in enumerate(problem.modes) for part in _mode(k, mode, names)]
    table = ",\n".join(f"    {_entry(k, mode, len(problem.states))}" for k, mode in enumerate(problem.modes))
    return "\n".join([head, *surface, *modes, f"static const ModeTable MODES[] = {{\n{table}\n}};\n"])


def _followed(mode: Mode) -> list[Guard]:
    """Guards whose values are integrated with the states, so that their error is controlled."""
    return [guard for guard in mode.guards if not guard.linear]


def _mode(index: int, mode: Mode, names: Mapping[str, str]) -> list[str]:
    """Write the functions of one mode. Its unknowns are the states and the values of the followed guards."""
    followed = _followed(mode)
    field = [*mode.field, *(guard.rate for guard in followed)]
    columns = len(mode.field) + len(followed)
    entries = {
        row + column * columns: text
        for row, texts in enumerate([*mode.jacobian, *(guard.rate_slopes for guard in followed)])
        for column, text in enumerate(texts)
    }
    return [
        _function(f"field_{index}", field, names),
        _function(f"values_{index}", [guard.expression for guard in mode.guards], names),
        _function(f"start_{index}", [guard.expression for guard in followed], names),
        _matrix(f"jacobian_{index}", entries, names),
        _successor(f"successor_{index}", mode.guards, names),
    ]


def _function(name: str, texts: Sequence[str], names: Mapping[str, str]) -> str:
    return _matrix(name, dict(enumerate(texts)), names)


def _matrix(name: str, entries: Mapping[int, str], names: Mapping[str, str]) -> str:
    lines = [f"    out[{k}] = {renamed(text, names)};" for k, text in entries.items()]
    quiet = "    (void)t, (void)x, (void)p, (void)out;"
    return "\n".join([f"static void {name}({ARGUMENTS}, double *out)", "{", quiet, *lines, "}\n"])


def _successor(name: str, guards: Sequence[Guard], names: Mapping[str, str]) -> str:
    lines = []
    for k, guard in enumerate(guards):
        for successor in guard.successors:
            holds = "".join(f" && ({renamed(text, names)}) >= 0.0" for text in successor.when)
            follows = str(successor.mode) if successor.ends is None else successor.ends.upper()
            lines.append(f"    if (guard == {k}{holds}) return {follows};")
    quiet = "    (void)guard, (void)t, (void)x, (void)p;"
    return "\n".join([f"static int {name}(int guard, {ARGUMENTS})", "{", quiet, *lines, "    return NONE;", "}\n"])


def _entry(index: int, mode: Mode, states: int) -> str:
    kinds = ", ".join(guard.kind.upper() for guard in mode.guards) or "VALID"
    surface = next((k for k, guard in enumerate(mode.guards) if guard.kind == "surface"), -1)
    unarmed = sum(1 << k for k, guard in enumerate(mode.guards) if not guard.armed)
    functions = ", ".join(f"{what}_{index}" for what in ("field", "jacobian", "values", "start", "successor"))
    unknowns = states + len(_followed(mode))
    return f"{{{mode.mode}, {unknowns}, {len(mode.guards)}, {surface}, {unarmed}, {{{kinds}}}, {functions}}}"


@dataclass(frozen=True)
class CvodeFromC(ProgramSolver):
    """CVODE called from a C program.

    Counts: ``steps`` are internal steps, ``rhs_evaluations`` is CVODE's own count, ``event_evaluations`` counts joint
    evaluations of all guards.
    """

    @property
    def version(self) -> str:
        """Version of SUNDIALS; empty if its headers are not installed."""
        return library_version()

    def check(self) -> None:
        """Raise :class:`~henon_ref.errors.UnavailableError` if the program cannot be compiled."""
        tools()

    def built(self, text: Problem) -> tuple[str, ...]:
        """Return the program for this system; compile it if it is not in the cache."""
        return str(program_for(c_equations(text))), *self.command


ADAMS = CvodeFromC("cvode-c-adams", ("adams",), landing="illinois")
BDF = CvodeFromC("cvode-c-bdf", ("bdf",), landing="illinois")
