"""The page: every section computed, drawn and written, and the table of all claims in front.

A section is a module with ``section(folder) -> Section`` that saves its figures in the folder.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from henon_ref.harness.report.manifest import Provenance
from henon_ref.harness.studies.page import write
from henon_ref.harness.studies.paper import appendix, fig8, section2, section3, section4, section5
from henon_ref.harness.studies.paper.claims import Section
from henon_ref.harness.studies.study import Asked, Made
from henon_ref.harness.table import Table

FOLDER = "paper"
SECTIONS: dict[str, Callable[[Path], Section]] = {
    "Section 2": lambda folder: section2.section(),
    "Section 3": section3.section,
    "Section 4.1": section4.section,
    "Section 4.2, Fig. 8": fig8.section,
    "Section 5, Lyapunov exponents": section5.section,
    "Appendix": appendix.section,
}
"""What the page is made of, in the paper's order."""

_VERDICTS = ("reproduced", "corrected", "not reproducible", "fails")


def run_paper(asked: Asked) -> Made:
    """Compute everything and write the page and its figures."""
    folder = asked.out / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for name, section in SECTIONS.items():
        asked.tell(name)
        made.append(section(folder))
    failed = [claim for section in made for claim in section.claims if claim.verdict == "fails"]
    page = write_sections(made, asked.origin, folder)
    return Made(page, [f"fails: {claim.where}: {claim.says}" for claim in failed], holds=not failed)


def write_sections(sections: Sequence[Section], origin: Provenance, folder: Path) -> Path:
    """Write the page of sections whose figures are in the folder."""
    claims = [claim for section in sections for claim in section.claims]
    counts = Counter[str](claim.verdict for claim in claims)
    rows: list[tuple[str, ...]] = [(claim.where, claim.says, f"**{claim.verdict}**", claim.how) for claim in claims]
    context = {
        "claims": len(claims),
        "tally": ", ".join(f"{counts[verdict]} {verdict}" for verdict in _VERDICTS if counts[verdict]),
        "table": Table(("where", "what it says", "verdict", "evidence"), "llll", rows).markdown,
        "sections": sections,
        "origin": origin,
    }
    return write(folder, "paper", context)
