"""A source tree with this project's build, and small C sources that compile quickly."""

from __future__ import annotations

import shutil
from pathlib import Path

from build_backend.libraries import SOURCES

ROOT = Path(__file__).parents[2]
HEADER = """/* What is exported. */
#ifndef SMALL_H
#define SMALL_H
#include <stdint.h>
#define HENON_EXPORT __attribute__((visibility("default")))
#define SIZE 3
#define LARGER(a, b) ((a) > (b) ? \\
                      (a) : (b))
enum kind { SLIP, STICK = 4 };
typedef struct {
    int32_t kind;
    double values[SIZE]; // three
} item;
HENON_EXPORT double weighted(const item *one, double weight);
#endif
"""
SOURCE = """#include "{name}.h"
#include "part.c"
#include "self_test.h"
HENON_EXPORT double weighted(const item *one, double weight) {{ return weight * sum(one); }}
"""
PART = "static double sum(const item *one) { return (one->values[0] + one->values[1]) + one->values[2]; }\n"
PROJECT = """[build-system]
requires = ["setuptools>=77"]
build-backend = "build_backend.backend"
backend-path = ["."]
[project]
name = "henon-ref"
version = "0.1.0"
[tool.setuptools.package-data]
"*" = ["*.c", "*.h"]
"""


def small_tree(root: Path) -> Path:
    """Write the tree; its root."""
    root.mkdir(parents=True)
    shutil.copytree(ROOT / "build_backend", root / "build_backend", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "setup.py", root)
    (root / "pyproject.toml").write_text(PROJECT, encoding="utf-8")
    (root / "cases").mkdir()
    for folder, text in (("baselines", '"""The solvers."""\n'), ("henon_ref/baselines", "__path__ = []\n")):
        (root / folder).mkdir(parents=True)
        (root / folder / "__init__.py").write_text(text, encoding="utf-8")
    for source in map(Path, SOURCES):
        folder = root / source.parent
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{source.stem}.h").write_text(HEADER, encoding="utf-8")
        (folder / source.name).write_text(SOURCE.format(name=source.stem), encoding="utf-8")
        (folder / "part.c").write_text(PART, encoding="utf-8")
        shutil.copy(ROOT / "henon_ref/kernel/self_test.h", folder)
    shutil.copy(ROOT / "henon_ref/kernel/compilation.py", root / "henon_ref/kernel")
    return root
