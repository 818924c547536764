"""A program: what ``pip install -e PACKAGE`` does for a package of one module, without an installer.

``python tests/support/editable.py FOLDER install -e PACKAGE``: FOLDER is on the path of those who import it.
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path


def install(package: Path, place: Path) -> None:
    """Make the modules and entry points of a package known in a folder."""
    project = tomllib.loads((package / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for module in (package / "src").glob("*.py"):
        (place / module.name).unlink(missing_ok=True)
        (place / module.name).symlink_to(module.resolve())
    information = place / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    information.mkdir(exist_ok=True)
    head = f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    (information / "METADATA").write_text(head, encoding="utf-8")
    lines = [
        line
        for group, points in project.get("entry-points", {}).items()
        for line in (f"[{group}]", *(f"{name} = {target}" for name, target in points.items()))
    ]
    (information / "entry_points.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


def main() -> None:
    """Install what the command line names."""
    place, *words = sys.argv[1:]
    assert words[:1] == ["install"], f"pip {' '.join(words)}: only 'install -e PACKAGE' is done here"
    names = [word for word in words[1:] if not word.startswith("-")]
    for name in names:
        install(Path(name.partition("[")[0]), Path(place))


if __name__ == "__main__":
    main()
