"""What the build adds to setuptools: the libraries, and a wheel for a platform and any Python."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import ClassVar

from setuptools import Command, Distribution
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build import build
from setuptools.errors import CompileError

from build_backend.compilers import CompilerError
from build_backend.libraries import ROOT, compile_all, compiler, installed, library_files


class PlatformDistribution(Distribution):
    """A distribution that is not for any platform, though it has no extension modules."""

    def has_ext_modules(self) -> bool:
        """True: what is installed depends on the processor."""
        return True


class Build(build):
    """setuptools' build, and then the libraries."""

    sub_commands: ClassVar = [*build.sub_commands, ("build_libraries", None)]

    def run(self) -> None:
        """Build into an empty folder: an earlier build leaves nothing to a wheel."""
        shutil.rmtree(self.build_lib, ignore_errors=True)
        super().run()


class BuildLibraries(Command):
    """Compile the C sources: beside the modules that are built or, for an editable installation, in the tree."""

    user_options: ClassVar[list[tuple[str, str, str]]] = []
    editable_mode = False

    def initialize_options(self) -> None:
        """Nothing is an option."""
        self.build_lib: str | None = None

    def finalize_options(self) -> None:
        """Take the folder of the modules."""
        self.set_undefined_options("build_py", ("build_lib", "build_lib"))

    def run(self) -> None:
        """Compile; what is wrong is said in one line."""
        try:
            compile_all(ROOT if self.editable_mode else self._folder())
        except CompilerError as error:
            raise CompileError(str(error)) from error

    def _folder(self) -> Path:
        assert self.build_lib is not None  # setuptools calls finalize_options first
        return Path(self.build_lib)

    def get_source_files(self) -> list[str]:
        """What an sdist needs besides the modules of a wheel: this package, and the door to ``baselines`` in a tree."""
        folders = (ROOT / "build_backend", ROOT / "henon_ref/baselines")
        return [file.relative_to(ROOT).as_posix() for folder in folders for file in sorted(folder.glob("*.py"))]

    def get_outputs(self) -> list[str]:
        """The libraries, as they lie in a wheel."""
        return list(self.get_output_mapping())

    def get_output_mapping(self) -> dict[str, str]:
        """The libraries as they lie in a wheel and in an editable tree."""
        return {str(self._folder() / installed(file)): str(file) for file in library_files()}


class PlatformWheel(bdist_wheel):
    """A wheel for any Python 3, since the libraries are called by ``cffi``, on one platform."""

    def get_tag(self) -> tuple[str, str, str]:
        """``py3-none-PLATFORM``."""
        _, _, platform = super().get_tag()
        return "py3", "none", compiler().wheel_platform or platform

    def write_wheelfile(self, wheelfile_base: str, *args: str) -> None:
        """Write the last file before all is packed; permissions are those of no builder's umask."""
        super().write_wheelfile(wheelfile_base, *args)
        for file in Path(wheelfile_base).parent.rglob("*"):
            file.chmod(0o755 if file.is_dir() else 0o644)
