"""Page of the paper: the table of all checked claims, followed by the sections.

``paper.yaml`` has the text of the page; the functions of :data:`SECTIONS` compute its numbers and checks.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from ruamel.yaml import YAML

from henon_ref.commands import status_line
from henon_ref.harness.studies.page import write
from henon_ref.harness.studies.paper import audit, equations, fig8, section3, section5
from henon_ref.harness.studies.paper.systems import Findings
from henon_ref.harness.studies.study import StudyRequest, StudyResult
from henon_ref.harness.table import Table

SECTIONS: Mapping[str, Callable[[], Findings]] = {
    "section_2": equations.section_2,
    "section_3": section3.section,
    "section_4": equations.section_4,
    "fig_8": fig8.section,
    "section_5": section5.section,
    "appendix": audit.section,
}
"""Functions that compute the sections of ``paper.yaml``."""

VERDICTS = ("reproduced", "corrected", "not reproducible", "fails")


def read_sections() -> list[dict[str, Any]]:
    """Read the sections of ``paper.yaml``."""
    sections: list[dict[str, Any]] = YAML(typ="safe").load(Path(__file__).with_name("paper.yaml"))
    return sections


def claims_of(section: Mapping[str, Any], found: Findings) -> Iterator[dict[str, str]]:
    """Yield the claims of a section with their verdicts (``fails`` if the check does not hold) and evidence.

    A check or a value of ``paper.yaml`` that is not in the findings raises KeyError.
    """
    for claim in section["claims"]:
        holds = "check" not in claim or found.holds[claim["check"]]
        verdict = claim.get("verdict", VERDICTS[0]) if holds else VERDICTS[-1]
        yield claim | {"verdict": verdict, "how": claim["how"].format_map(found.values)}


def text_of(section: Mapping[str, Any], found: Findings) -> str:
    """Return the text of a section, with its figures."""
    captions = section.get("captions", {})
    pictures = {name: f"![{captions[name]}]({name}.svg)\n\n*{captions[name]}*" for name in found.figures}
    return str(section["text"].format_map({**found.values, **pictures}))


def run_paper(request: StudyRequest) -> StudyResult:
    """Compute everything and write the page and its figures."""
    shown: list[dict[str, str]] = []
    claims: list[dict[str, str]] = []
    figures: dict[str, Figure] = {}
    files: dict[str, str] = {}
    for section in read_sections():
        status_line.show(section["title"])
        found = SECTIONS[section["of"]]()
        claims += claims_of(section, found)
        shown.append({"title": section["title"], "text": text_of(section, found)})
        figures |= {f"{name}.svg": figure for name, figure in found.figures.items()}
        files |= found.files
    counts = Counter(claim["verdict"] for claim in claims)
    rows = [(claim["where"], claim["says"], f"**{claim['verdict']}**", claim["how"]) for claim in claims]
    context = {
        "claims": len(claims),
        "tally": ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict]),
        "table": Table(("where", "what it says", "verdict", "evidence"), "llll", rows).markdown,
        "sections": shown,
        "origin": request.origin,
    }
    failed = [f"fails: {claim['where']}: {claim['says']}" for claim in claims if claim["verdict"] == "fails"]
    return StudyResult(write(request.folder, "paper", context, files, figures), failed, holds=not failed)
