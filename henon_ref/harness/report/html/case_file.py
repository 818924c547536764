"""What the page shows of a case besides its rows, kept in the case's folder: words of the case file, portraits."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from henon_ref.harness.campaign.comparison import Comparison
from henon_ref.harness.report.manifest import json_text
from henon_ref.text import one_line

CASE_FILE = "page.json"
SCHEMA = 1


def case_text(comparison: Comparison) -> str:
    """The file's content: tags, source, each reading's story and portrait."""
    readings = [result.reading for result in comparison.readings]
    stories = {reading.name: " ".join((reading.story or "").split()) for reading in readings}
    content = {
        "schema": SCHEMA,
        "tags": [one_line(tag) for tag in dict.fromkeys(tag for reading in readings for tag in reading.tags)],
        "source": one_line(comparison.case.source or ""),
        "stories": {name: one_line(story) for name, story in stories.items() if story},
        "portraits": _portraits(comparison),
    }
    return json_text(content) + "\n"


def _portraits(comparison: Comparison) -> dict[str, dict[str, Any]]:
    """The portrait of each reading that was sampled, by the reading's name."""
    from henon_ref.figures.curves import curves_of
    from henon_ref.figures.motion import motion_of
    from henon_ref.harness.report.html.portrait import packed

    found = {}
    for result in comparison.readings:
        if result.samples is None or result.expected is None:
            continue
        motion = motion_of(result.samples, result.expected.transitions)
        if motion is not None:
            found[result.reading.name] = packed(curves_of(result.reading.problem.system, motion))
    return found


def read_case_file(folder: Path) -> dict[str, Any]:
    """The content of a case folder's file; empty where it has none, or one of another version."""
    try:
        content = json.loads((folder / CASE_FILE).read_text(encoding="utf-8"))
    except (FileNotFoundError, RecursionError, ValueError):
        return {}
    return content if isinstance(content, dict) and content.get("schema") == SCHEMA else {}
