"""Machine code is kept on disk, used again, and never trusted where it is not what was written."""

from __future__ import annotations

import ctypes
from pathlib import Path

import llvmlite.binding as llvm
import pytest

from henon_ref.errors import ArgumentError
from henon_ref.jit import native_module as machine
from henon_ref.jit.native_module import NativeModule

IR = """\
define double @answer(double %x) {
entry:
  %y = fmul double %x, 2.0
  ret double %y
}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HENON_REF_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache" / "objects"


def answer(ir: str = IR) -> float:
    code = NativeModule(ir)
    return float(ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(code.address("answer"))(21.0))


def refuse(monkeypatch: pytest.MonkeyPatch) -> None:
    """From here on nothing is compiled."""

    def no(*_: object) -> None:
        raise AssertionError("compiled again")

    monkeypatch.setattr(llvm, "create_pass_builder", no)


def test_a_module_is_compiled_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert answer() == 42.0
    assert len(list(folder.iterdir())) == 1
    refuse(monkeypatch)
    assert answer() == 42.0
    with pytest.raises(AssertionError, match="compiled again"):
        answer(IR.replace("2.0", "3.0"))


@pytest.mark.parametrize("spoilt", [b"", b"short", None])
def test_a_spoilt_object_is_not_used(folder: Path, spoilt: bytes | None) -> None:
    answer()
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    file.write_bytes(whole[:-1] if spoilt is None else spoilt)
    assert answer() == 42.0
    assert file.read_bytes() == whole


def test_code_of_another_machine_is_not_used(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answer()
    monkeypatch.setattr(machine, "_maker", lambda: "another machine")
    refuse(monkeypatch)
    with pytest.raises(AssertionError, match="compiled again"):
        answer()


@pytest.mark.parametrize("name", ["no-such-processor", "i386"])
def test_a_processor_that_llvm_does_not_have_is_one_error(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HENON_REF_CPU", name)  # LLVM would abort the process
    with pytest.raises(ArgumentError, match=f"the variable HENON_REF_CPU is '{name}'; wanted LLVM's name"):
        NativeModule(IR)


def test_a_folder_that_takes_nothing_is_no_error(folder: Path) -> None:
    folder.parent.mkdir()
    folder.write_text("a file in its place")
    assert answer() == 42.0


def test_the_folder_does_not_grow_without_bound(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "MAX_OBJECTS", 4)
    for factor in range(2, 12):
        assert answer(IR.replace("2.0", f"{factor}.0")) == 21.0 * factor
        assert len(list(folder.iterdir())) <= 4
    refuse(monkeypatch)
    assert answer(IR.replace("2.0", "11.0")) == 231.0
