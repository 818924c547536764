"""LLVM IR to callable machine code by llvmlite, kept on disk by a hash of the IR, or of what that is made from."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

import llvmlite
import llvmlite.binding as llvm

from henon_ref.jit.cache_files import read, write
from henon_ref.jit.cache_folder import OBJECTS, cache_root
from henon_ref.jit.target import target

KEPT = 2048
"""Objects kept on disk; when there are more, the half that was not used for longest goes."""
_FORM = 2
"""Number of the form that objects have on disk."""


def _target(*, optimised: bool) -> llvm.TargetMachine:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    processor, features = target()
    made = llvm.Target.from_default_triple()
    return made.create_target_machine(cpu=processor, features=features, opt=2 if optimised else 0, jit=True)


class NativeModule:
    """A compiled module; its functions live as long as this object does.

    Parameters
    ----------
    ir : str or callable
        LLVM IR with opaque pointers; or, with a ``key``, what writes it where the disk does not have the code.
    optimised : bool
        Without it a module of 40,000 lines, as one long block, is compiled in 1.3 s in place of 12 s; it computes the
        same bits.
    simplified : bool, optional
        Whether the IR is simplified first; as ``optimised`` if left out. Loops over short pieces of code that has
        nothing to simplify are as fast without, and compiled in 0.7 in place of 1.8 s.
    key : str, optional
        Everything that the IR depends on, the program that writes it included (:func:`source_hash`); the IR itself if
        left out.
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
        file = _objects() / hashlib.sha256((_maker() + level + name).encode()).hexdigest()
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
        # The execution engine takes over the module and the target machine: each has its own.
        self._engine = llvm.create_mcjit_compiler(module, machine)
        self._engine.set_object_cache(lambda _, made: _write(file, made), lambda _: None)
        self._engine.finalize_object()

    def address(self, name: str) -> int:
        """Address of one of its functions."""
        return int(self._engine.get_function_address(name))


@cache
def source_hash(*patterns: str) -> str:
    """Hash of the package's files that match some patterns, such as ``taylor/llvm/*.py``."""
    package, made = Path(__file__).parents[1], hashlib.sha256()
    for file in sorted(file for pattern in patterns for file in package.glob(pattern)):
        made.update(f"{file.relative_to(package)}\n".encode() + file.read_bytes())
    return made.hexdigest()


@cache
def _maker() -> str:
    """What machine code depends on apart from the IR."""
    version = ".".join(map(str, llvm.llvm_version_info))
    return f"{_FORM} {llvmlite.__version__} {version} {' '.join(target())}\n"


def _objects() -> Path:
    return cache_root() / OBJECTS


def _read(file: Path) -> bytes | None:
    """An object from the disk; None where there is none, or not the one that was written."""
    known = read(file)
    if known is not None:
        with suppress(OSError):  # its time cannot be set: it may be removed before its turn
            os.utime(file)
    return known


def _write(file: Path, made: bytes) -> None:
    """Keep an object; a disk that takes nothing costs the next compilation, no more."""
    with suppress(OSError):
        write(file, made)
        _prune(file.parent)


def _prune(folder: Path) -> None:
    entries = list(os.scandir(folder))
    if len(entries) > KEPT:
        for entry in sorted(entries, key=lambda one: one.stat().st_mtime)[: KEPT // 2]:
            Path(entry.path).unlink(missing_ok=True)
