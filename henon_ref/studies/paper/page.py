"""The page: every section computed, drawn and written, and the table of all claims in front.

A section is a module with ``section(folder) -> Section`` that saves its figures in the folder.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path

from henon_ref.report.files.manifest import Provenance
from henon_ref.studies.paper import appendix, fig8, section2, section3, section4, section5
from henon_ref.studies.paper.claims import Claim, Section

PAGE = "README.md"

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


def write_page(folder: Path, origin: Provenance, tell: Callable[[str], None]) -> list[Section]:
    """Compute everything and write the page and its figures.

    Parameters
    ----------
    folder : Path
        Made if it is not there.
    origin : Provenance
    tell : callable
        Told the name of each section as its work begins.

    Raises
    ------
    OSError
        If the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for name, section in SECTIONS.items():
        tell(name)
        made.append(section(folder))
    (folder / PAGE).write_text(page_text(made, origin), encoding="utf-8")
    return made


def page_text(sections: list[Section], origin: Provenance) -> str:
    """The page as markdown."""
    claims = [claim for section in sections for claim in section.claims]
    counts = Counter[str](claim.verdict for claim in claims)
    tally = ", ".join(f"{counts[verdict]} {verdict}" for verdict in _VERDICTS if counts[verdict])
    parts = [_HEAD.format(count=len(claims), tally=tally), _table(sections)]
    parts += [f"## {section.title}\n\n{section.text}" for section in sections]
    commit = f", from commit {origin.commit[:12]}" if origin.commit else ""
    parts.append(_FOOT.format(rerun=origin.rerun, machine=origin.machine_text, commit=commit))
    return "\n".join(part.rstrip("\n") + "\n" for part in parts)


def _table(sections: list[Section]) -> str:
    lines = ["## Every number and equation", "", "| where | what it says | verdict | evidence |", "|---|---|---|---|"]
    lines += [_row(claim) for section in sections for claim in section.claims]
    return "\n".join(lines) + "\n"


def _row(claim: Claim) -> str:
    cells = (claim.where, claim.says, f"**{claim.verdict}**", claim.how)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


_HEAD = """\
# The paper, computed again

P. Olejnik, J. Awrejcewicz, *Application of Hénon method in numerical estimation of the stick-slip transitions existing
in Filippov-type discontinuous dynamical systems with dry friction*, Nonlinear Dynamics 73 (2013) 723-736,
[doi:10.1007/s11071-013-0826-7](https://doi.org/10.1007/s11071-013-0826-7).

**What holds.** The analysis holds: transition function, tangent points and boundary values of mu0 come out of SymPy as
printed. The idea of the method holds: swapping the independent variable keeps order 4 at the transitions. **What does
not:** the stick durations and lengths of Fig. 8 are not those of Eqs. (17) and (18), which do not stick on their
attractor; they come from two mistakes of the listing together, and their last digit from its step. Sticks do occur in
Fig. 4. Eqs. (1), (15), (17) and (27) have misprints; with the sign of (27) as printed the rig flutters until it loses
contact. Every motion of the rig that sticks has an exponent of -infinity, which no time series can show.

Of {count} numbers, equations, figures and statements below: {tally}.
What can be checked by computing was, when this page was written; the evidence holds the figures of that run.
"""

_FOOT = """\
## How to read this

Made by

    {rerun}

on {machine}{commit}. The tables of the appendix are in [audit.csv](audit.csv) in full.
Figures and starts that the paper does not give are ours, as said where they are used.
"""
