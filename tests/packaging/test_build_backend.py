"""The build: the compiler that it takes, what wheel, sdist and editable tree hold, and that a wheel is reproducible."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path
from zipfile import ZipFile

import pytest
from packaging.requirements import Requirement
from small_tree import small_tree

from build_backend.compilers import COMMANDS, PLATFORM_VARIABLE, PLATFORMS, ZIGLANG, Compiler, CompilerError, choose
from build_backend.libraries import FLAGS, compile_all, compiler, installed, library_files
from henon_ref.kernel.compilation import variants

PATH = os.environ["PATH"]
try:
    HERE = shutil.which(compiler().command[0])
except CompilerError:
    HERE = None
VARIANTS = variants()
COMPILES = f'PATH="{PATH}" exec "{HERE}" "$@"'
"""A script that is this machine's compiler."""
WITH_COMPILER = pytest.mark.skipif(HERE is None, reason="no C compiler works here")


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The only folder on the path, where no command lies; ziglang is not installed."""
    folder = tmp_path / "path"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("build_backend.compilers.find_spec", lambda _: None)
    return folder


def write_command(file: Path, script: str) -> None:
    file.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    file.chmod(0o755)


def chosen() -> Compiler:
    return choose(FLAGS, [variant.architecture for variant in VARIANTS])


@WITH_COMPILER
@pytest.mark.parametrize("name", COMMANDS)
def test_the_machines_compiler_is_taken_by_any_of_its_names(path: Path, name: str) -> None:
    write_command(path / name, COMPILES)
    assert chosen() == Compiler((name,))


@WITH_COMPILER
@pytest.mark.parametrize(
    "broken",
    [
        "echo 'xcode-select: no developer tools were found' >&2; exit 1",
        "exit 0",  # it makes nothing
        f'for word in "$@"; do case $word in -march=*-v3|-march=armv9*) exit 1;; esac; done; {COMPILES}',
    ],
    ids=["stub", "silent", "old"],
)
def test_a_command_that_does_not_compile_is_passed_over(path: Path, broken: str) -> None:
    if "-march" in broken and len(VARIANTS) == 1:
        pytest.skip("one kind of processor here")
    write_command(path / "cc", broken)
    with pytest.raises(CompilerError, match=r"^there is no C compiler that works"):
        chosen()
    write_command(path / "clang", COMPILES)
    assert chosen() == Compiler(("clang",))


@pytest.mark.parametrize("name", PLATFORMS)
def test_a_wheel_for_another_platform_is_compiled_by_ziglang(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(PLATFORM_VARIABLE, name)
    monkeypatch.setattr("build_backend.compilers.find_spec", lambda _: True)
    found = chosen()
    assert found.is_ziglang
    assert found.wheel_platform == PLATFORMS[name].wheel
    line = found.line(FLAGS, None, "kernel.c", "kernel.so")
    assert line[line.index("-target") + 1] == PLATFORMS[name].target
    assert ("-Wl,--build-id=none" in line) == ("linux" in name)  # what links for other systems does not know it
    assert {each.name for each in variants(PLATFORMS[name].machine)} in (
        {"x86-64", "x86-64-v3"},
        {"arm64"},
        {"aarch64"},
    )


def test_what_a_linker_leaves_beside_a_library_is_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    leaves = 'while [ "$1" != -o ]; do shift; done\nfor end in "" .pdb .lib; do echo > "$2$end"; done'
    write_command(tmp_path / "linker", leaves)
    monkeypatch.setattr("build_backend.libraries.compiler", lambda: Compiler((str(tmp_path / "linker"),)))
    into = tmp_path / "into"
    compile_all(into)
    found = {file.relative_to(into) for file in into.rglob("*") if not file.is_dir()}
    assert found == {installed(file) for file in library_files()}


def test_a_platform_that_is_not_known_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(PLATFORM_VARIABLE, "sparc")
    with pytest.raises(CompilerError, match=r"^HENON_REF_PLATFORM is 'sparc'; it may be linux-x86_64, "):
        chosen()


def test_without_a_compiler_one_sentence_names_what_to_install(path: Path) -> None:
    with pytest.raises(CompilerError) as caught:
        chosen()
    assert str(caught.value) == (
        "there is no C compiler that works (cc, gcc, clang), and the package ziglang, which holds one, is not "
        f"installed: install one of them (apt-get install gcc libc6-dev, or pip install {ZIGLANG})"
    )


@WITH_COMPILER
def test_cc_is_taken_with_its_arguments_or_refused(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_command(path / "cc", COMPILES)
    write_command(path / "launcher", '[ "$1" = own ] || exit 1\nshift\n' + COMPILES)
    monkeypatch.setenv("CC", "launcher own")
    assert chosen() == Compiler(("launcher", "own"))
    monkeypatch.setenv("CC", "launcher")
    with pytest.raises(CompilerError, match=r"^CC is 'launcher', which does not compile for "):
        chosen()


def test_ziglang_is_taken_where_it_is_asked_for_or_there_is_no_other(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("build_backend.compilers.find_spec", lambda name: name == "ziglang")
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    found = chosen()
    assert found.command == (sys.executable, "-m", "ziglang", "cc", "-target", "x86_64-linux-gnu.2.28")
    assert found.wheel_platform == "manylinux_2_28_x86_64"
    assert "-march=x86_64_v3" in found.line(FLAGS, "x86-64-v3", "a.c", "a.so")
    if HERE is not None:
        write_command(path / "gcc", COMPILES)
        assert not chosen().is_ziglang
    monkeypatch.setenv("CC", "ziglang")
    assert chosen() == found


HOOK = """
import os, sys
sys.path.insert(0, os.getcwd())
from build_backend import backend
print(getattr(backend, sys.argv[1])(*sys.argv[2:]))
"""


def hook(tree: Path, name: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """A hook of the backend, called in a tree as pip calls it."""
    pytest.importorskip("setuptools.command.bdist_wheel")
    own = {key: value for key, value in os.environ.items() if key not in ("CC", "SOURCE_DATE_EPOCH")}
    line = [sys.executable, "-c", HOOK, name, *arguments]
    return subprocess.run(
        line, cwd=tree, env=own | environment, capture_output=True, text=True, check=False, timeout=120
    )


@pytest.mark.parametrize(("kind", "asks"), [("wheel", True), ("editable", True), ("sdist", False)])
def test_ziglang_is_asked_for_where_nothing_else_compiles(tmp_path: Path, path: Path, kind: str, asks: bool) -> None:
    done = hook(small_tree(tmp_path / "tree"), f"get_requires_for_build_{kind}", PATH=str(path))
    assert done.returncode == 0, done.stderr
    assert ("ziglang[no-c-compiler-works-here]==" in done.stdout) == asks


@pytest.mark.parametrize(
    ("cc", "here", "asks"),
    [("", True, False), ("ziglang", True, True), ("ziglang", False, True), ("mine", False, False)],
)
def test_ziglang_is_not_asked_for_in_place_of_a_compiler_that_was_named(
    path: Path, monkeypatch: pytest.MonkeyPatch, cc: str, here: bool, asks: bool
) -> None:
    backend = pytest.importorskip("build_backend.backend", exc_type=ImportError)
    if here and HERE is None:
        pytest.skip("no C compiler works here")
    if here:
        write_command(path / "cc", COMPILES)
    monkeypatch.setenv("CC", cc)
    monkeypatch.setattr(backend, "compiler", chosen)
    assert [Requirement(text).name for text in backend.compiler_package()] == ["ziglang"] * asks


@pytest.mark.parametrize("kind", ["wheel", "editable"])
def test_a_build_without_a_compiler_ends_in_one_line(tmp_path: Path, path: Path, kind: str) -> None:
    done = hook(small_tree(tmp_path / "tree"), f"build_{kind}", str(tmp_path), PATH=str(path), CC="mine")
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: CC is 'mine', which does not compile for ")


def built(tree: Path, kind: str, into: Path) -> Path:
    """What a hook builds into a folder."""
    into.mkdir()
    done = hook(tree, f"build_{kind}", str(into))
    assert done.returncode == 0, done.stderr
    return into / done.stdout.splitlines()[-1]


@WITH_COMPILER
def test_a_wheel_is_for_any_python_and_the_same_bytes_from_tree_and_sdist(tmp_path: Path) -> None:
    tree = small_tree(tmp_path / "tree")
    wheel = built(tree, "wheel", tmp_path / "wheel")
    umask = os.umask(0o002)
    with tarfile.open(built(tree, "sdist", tmp_path / "sdist")) as sdist:
        assert not [name for name in sdist.getnames() if name.endswith((".so", ".pyc"))]
        sdist.extractall(tmp_path / "a folder elsewhere", filter="fully_trusted")
    (unpacked,) = (tmp_path / "a folder elsewhere").iterdir()
    for number, file in enumerate(unpacked.rglob("*.*")):
        os.utime(file, (1e9 + number, 1e9 + number))
    again = built(unpacked, "wheel", tmp_path / "again")
    os.umask(umask)
    assert again.name == wheel.name
    assert again.read_bytes() == wheel.read_bytes()
    assert re.fullmatch(r"henon_ref-0\.1\.0-py3-none-(?!any)\w+\.whl", wheel.name)
    with ZipFile(wheel) as packed:
        assert packed.read("henon_ref/baselines/__init__.py") == (tree / "baselines/__init__.py").read_bytes()
        assert (unpacked / "henon_ref/baselines/__init__.py").is_file()  # for an editable installation
        libraries = {installed(file).as_posix() for file in library_files()}
        assert {name for name in packed.namelist() if name.endswith(".so")} == libraries
        assert b"Root-Is-Purelib: false" in packed.read("henon_ref-0.1.0.dist-info/WHEEL")
        for library in libraries:
            assert str(tmp_path).encode() not in packed.read(library)


@WITH_COMPILER
def test_an_editable_tree_has_its_libraries_beside_their_sources(tmp_path: Path) -> None:
    tree = small_tree(tmp_path / "tree")
    wheel = built(tree, "editable", tmp_path / "wheel")
    assert "-py3-none-" in wheel.name
    assert all((tree / file).exists() for file in library_files())
    with ZipFile(wheel) as packed:
        assert not [name for name in packed.namelist() if name.endswith(".so")]
