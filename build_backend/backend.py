"""The hooks of PEP 517 and PEP 660: those of setuptools, asking for a compiler where the machine has none."""

from __future__ import annotations

import os
import sys
from typing import Any

from setuptools import build_meta
from setuptools.build_meta import (
    build_sdist,
    get_requires_for_build_sdist,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

from build_backend.compilers import PLATFORM_VARIABLE, ZIGLANG, CompilerError
from build_backend.libraries import compiler

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]
Settings = dict[str, Any] | None
EARLIEST = "315532800"
"""1980, in seconds since 1970: the earliest time that a wheel can hold."""
WHY = "no-c-compiler-works-here"
"""Stands as an extra, which the package does not have, in what pip says where it cannot fetch the package."""


def get_requires_for_build_wheel(config_settings: Settings = None) -> list[str]:
    """What a wheel needs to be built: ``ziglang`` where no compiler works."""
    return [*build_meta.get_requires_for_build_wheel(config_settings), *compiler_package()]


def get_requires_for_build_editable(config_settings: Settings = None) -> list[str]:
    """What an editable installation needs to be built: as for a wheel."""
    return [*build_meta.get_requires_for_build_editable(config_settings), *compiler_package()]


def build_wheel(wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None) -> str:
    """Build a wheel: the same bytes from the same sources, whenever and in whatever folder."""
    require_compiler()
    os.environ.setdefault("SOURCE_DATE_EPOCH", EARLIEST)
    return build_meta.build_wheel(wheel_directory, config_settings, metadata_directory)


def build_editable(
    wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None
) -> str:
    """Build the libraries in the tree, and the wheel that points to it."""
    require_compiler()
    return build_meta.build_editable(wheel_directory, config_settings, metadata_directory)


def compiler_package() -> list[str]:
    """``ziglang`` where it has to compile; not where ``CC`` names a compiler that does not work: the build says so."""
    try:
        return [ZIGLANG] if compiler().is_ziglang else []
    except CompilerError:
        asked = None if os.environ.get(PLATFORM_VARIABLE) else os.environ.get("CC")
        return [] if asked not in (None, "", "ziglang") else [ZIGLANG.replace("==", f"[{WHY}]==")]


def require_compiler() -> None:
    """End with one line where nothing compiles, before setuptools adds its own to it."""
    try:
        compiler()
    except CompilerError as error:
        sys.exit(f"error: {error}")
