"""Compilation of LLVM IR to callable machine code by llvmlite, cached on disk by a hash of the IR or of its source.

The digits of the reference do not depend on the target. The optimiser may not fuse, reorder or approximate (no
``fastmath``, no flags in our LLVM IR). Fused operations are explicit (``fma``, done by the C library on processors
without it), sums keep their written order or independent parts, and vector code works lane by lane. The digits do
depend on the C library, for the functions that it computes (exponential, logarithm, power, tangent, the inverse and
hyperbolic functions, and the sines of states beyond 1e15). glibc has different versions for processors with and without
FMA and AVX2, versions change between releases, and other systems have their own library. Modes and Python's ``math``
call this one library; NumPy's functions, which depend on the processor, decide nothing.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

import llvmlite
import llvmlite.binding as llvm

from henon_ref.errors import ArgumentError
from henon_ref.jit.cache_folder import OBJECTS, cache_root, read, write
from henon_ref.kernel.library import CPU_VARIABLE

TRIED = """\
import sys
import llvmlite.binding as llvm
llvm.initialize_native_target()
llvm.initialize_native_asmprinter()
machine = llvm.Target.from_default_triple().create_target_machine(cpu=sys.argv[1])
machine.emit_object(llvm.parse_assembly("define void @f() { ret void }"))
"""
"""Program that compiles for the processor of its argument; LLVM aborts it, or complains on stderr, if it cannot."""
MAX_OBJECTS = 2048
"""Largest number of objects on disk; beyond it, the half that was unused for longest is removed."""


def target() -> tuple[str, str]:
    """LLVM's name and features of the processor for which this process compiles modes.

    It is this machine's processor with its features, unless the variable ``HENON_REF_CPU`` names a processor: then the
    features are that processor's own (empty). (``x86-64`` also selects the kernel's library for processors without
    fused operations.)
    """
    named = os.environ.get(CPU_VARIABLE)
    if named:
        _check_processor(named)
        return named, ""
    return llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


@cache
def _check_processor(name: str) -> None:
    """Raise ArgumentError if LLVM has no 64-bit processor of this name.

    It is tried in a process of its own, because LLVM aborts the process.
    """
    found = subprocess.run([sys.executable, "-c", TRIED, name], capture_output=True, text=True, check=False)
    if found.returncode != 0 or found.stderr:
        words = f"the variable {CPU_VARIABLE} is {name[:60]!r}"
        raise ArgumentError(f"{words}; wanted LLVM's name of a 64-bit processor, such as haswell, or no value")


def _target(*, optimised: bool) -> llvm.TargetMachine:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    processor, features = target()
    made = llvm.Target.from_default_triple()
    return made.create_target_machine(cpu=processor, features=features, opt=2 if optimised else 0, jit=True)


class NativeModule:
    """Compiled module; its functions exist as long as this object.

    Parameters
    ----------
    ir : str or callable
        LLVM IR with opaque pointers; or, with a ``key``, a function that writes it if the disk does not have the code.
    optimised : bool
        Without it, a module of 40,000 lines in one block compiles in 1.3 s instead of 12 s and computes the same bits.
    simplified : bool, optional
        Whether the IR is simplified first; by default as ``optimised``. Loops over short code without redundancy are as
        fast without it, and compile in 0.7 instead of 1.8 s.
    key : str, optional
        All on which the IR depends, including the program that writes it (:func:`source_hash`); by default the IR.
    """

    def __init__(
        self,
        ir: str | Callable[[], str],
        *,
        optimised: bool = True,
        simplified: bool | None = None,
        key: str | None = None,
    ) -> None:
        simplified = optimised if simplified is None else simplified
        machine = _target(optimised=optimised)
        text = ir if isinstance(ir, str) else None
        name = key if key is not None else text
        assert name is not None, "IR that is written only when it is needed has a key"
        level = "" if optimised and simplified else f"O{2 * optimised}{' simplified' * simplified}\n"
        file = cache_root() / OBJECTS / hashlib.sha256((_maker() + level + name).encode()).hexdigest()
        known = _read(file)
        if known is not None:
            self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
            self._engine.add_object_file(llvm.ObjectFileRef.from_data(known))
            self._engine.finalize_object()
            return
        module = llvm.parse_assembly(ir() if callable(ir) else ir)
        module.verify()
        if simplified:
            options = llvm.create_pipeline_tuning_options(speed_level=2)
            builder = llvm.create_pass_builder(machine, options)
            builder.getModulePassManager().run(module, builder)
        # The execution engine takes ownership of the module and the target machine, so none is shared.
        self._engine = llvm.create_mcjit_compiler(module, machine)
        self._engine.set_object_cache(lambda _, made: _write(file, made), lambda _: None)
        self._engine.finalize_object()

    def address(self, name: str) -> int:
        return int(self._engine.get_function_address(name))


@cache
def source_hash(*patterns: str) -> str:
    """Hash of the package's files that match the patterns, such as ``taylor/llvm/*.py``."""
    package, made = Path(__file__).parents[1], hashlib.sha256()
    for file in sorted(file for pattern in patterns for file in package.glob(pattern)):
        made.update(f"{file.relative_to(package)}\n".encode() + file.read_bytes())
    return made.hexdigest()


@cache
def _maker() -> str:
    """Text of everything besides the IR on which machine code depends; first the version of the objects' format."""
    version = ".".join(map(str, llvm.llvm_version_info))
    return f"2 {llvmlite.__version__} {version} {' '.join(target())}\n"


def _read(file: Path) -> bytes | None:
    """Return an object from the disk; None if it is missing or damaged."""
    known = read(file)
    if known is not None:
        with suppress(OSError):  # without a new time the object may be removed earlier
            os.utime(file)
    return known


def _write(file: Path, made: bytes) -> None:
    """Write an object; if the disk refuses it, only the next compilation costs time."""
    with suppress(OSError):
        write(file, made)
        _prune(file.parent)


def _prune(folder: Path) -> None:
    entries = list(os.scandir(folder))
    if len(entries) > MAX_OBJECTS:
        for entry in sorted(entries, key=lambda one: one.stat().st_mtime)[: MAX_OBJECTS // 2]:
            Path(entry.path).unlink(missing_ok=True)
