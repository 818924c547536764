"""A library is loaded where it is that of these sources, for this processor, with their arithmetic."""

from __future__ import annotations

import re
import shutil
import sys
from fractions import Fraction
from pathlib import Path

import pytest
from small_tree import HEADER, PART, small_tree

from build_backend.compilers import CompilerError
from build_backend.libraries import compile_all, compiler
from henon_ref.errors import KernelError
from henon_ref.kernel import compilation
from henon_ref.kernel.library import CPU_VARIABLE, SELF_TEST, declarations, load, processor_features

BUILD = re.escape(f"cd {Path(__file__).parents[2]} && {sys.executable} -m build_backend")
"""The line that builds the libraries anew."""
FUSED = pytest.mark.skipif("fma" not in processor_features(), reason="a processor that fuses nothing")


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A compiled tree."""
    try:
        compiler()
    except CompilerError as error:
        pytest.skip(str(error))
    root = small_tree(tmp_path_factory.mktemp("library") / "tree")
    compile_all(root, root=root)
    return root


@pytest.fixture
def tree(compiled: Path, tmp_path: Path) -> Path:
    """A test's own compiled tree: a process that has loaded a library gets it again by its path, whatever is there."""
    return shutil.copytree(compiled, tmp_path / "tree")


@pytest.fixture
def header(tree: Path) -> Path:
    return tree / "henon_ref/kernel/kernel.h"


def test_structures_constants_and_functions_are_those_of_the_header(header: Path) -> None:
    ffi, lib = load(header, "kernel")
    item = ffi.new("item *", {"kind": lib.STICK, "values": [1, 2, 4]})
    assert (lib.SIZE, item.kind, lib.weighted(item, 0.5)) == (3, 4, 3.5)


def test_the_library_of_a_processor_without_fused_operations_can_be_asked_for(
    header: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(CPU_VARIABLE, "x86-64")
    assert processor_features() == frozenset()
    load(header, "kernel")


@pytest.mark.parametrize(("file", "text"), [("part.c", PART), ("kernel.h", HEADER)])
def test_a_library_of_other_sources_is_refused(header: Path, file: str, text: str) -> None:
    header.with_name(file).write_text(text + "/* later */\n", encoding="utf-8")
    with pytest.raises(KernelError, match=f"was compiled from other sources .*: {BUILD}$"):
        load(header, "kernel")


def test_a_missing_library_is_named_with_the_line_that_builds_it(header: Path, tmp_path: Path) -> None:
    alone = tmp_path / header.name
    alone.write_text(HEADER, encoding="utf-8")
    with pytest.raises(KernelError, match=rf"_kernel\..*so is missing: {BUILD}$"):
        load(alone, "kernel")


@FUSED
@pytest.mark.parametrize("flags", ["-ffp-contract=fast", "-fassociative-math -fno-signed-zeros -fno-trapping-math"])
def test_a_library_with_other_arithmetic_is_refused(tree: Path, header: Path, flags: str) -> None:
    compile_all(tree, root=tree, extra=tuple(flags.split()))
    with pytest.raises(KernelError, match=f"was compiled with other arithmetic .*: {BUILD}$"):
        load(header, "kernel")


def test_the_self_test_has_the_value_of_rounded_operations() -> None:
    """Python fuses and reorders nothing; a fused operation is an exact one that is rounded once."""
    a, b, start, factor, large, smallest, scale = 1.4, 0.3, 0.1, 0.7, 2.0**30, 2.0**-1022, 2.0**54
    error = float(Fraction(start) * Fraction(factor) - Fraction(start * factor))
    x, y = (large + start) - large, (error * scale + smallest * factor / smallest) / 8
    for _ in range(100):
        x, y = (1 - a * x * x) + y, b * x
    assert x == SELF_TEST


def test_of_a_header_declarations_are_kept(tmp_path: Path) -> None:
    (tmp_path / "types.h").write_text("#pragma once\ntypedef struct { double x; } point;\n", encoding="utf-8")
    header = tmp_path / "one.h"
    text = '#include "types.h"\n#include <math.h>\n#if 1\n# define N 0x10 /* sixteen */\n#endif\n#define X 1.5\n'
    header.write_text(text + "HENON_EXPORT void f(point *p); /* # in\n# a comment */\n", encoding="utf-8")
    kept = [line.strip() for line in declarations(header).splitlines() if line.strip()]
    assert kept == ["typedef struct { double x; } point;", "# define N 0x10", "void f(point *p);"]


def test_included_files_count_once_even_in_a_circle(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    a, b, c = (tmp_path / name for name in ("a.c", "deep/b.h", "c.h"))
    a.write_text('#include "deep/b.h"\n #  include "c.h"\n#include <c.h>\n// #include "none.h"\n', encoding="utf-8")
    b.write_text('#include "../c.h"\n', encoding="utf-8")
    c.write_text('#include "deep/b.h"\n', encoding="utf-8")
    assert list(compilation.source_files(a)) == [c, b, a]


def test_each_kind_of_processor_gets_its_library(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    newer, older = compilation.variants()
    assert compilation.best(newer.features | {"avx512f"}) is newer
    assert compilation.best(newer.features - {"fma"}) is older
    monkeypatch.setattr("platform.machine", lambda: "aarch64")
    (only,) = compilation.variants()
    assert (only.name, only.architecture, compilation.best(frozenset())) == ("aarch64", None, only)
