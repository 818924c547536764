"""The list of cases, ``cases/README.md``, made from the case files themselves.

Run ``python docs/catalogue.py`` after a case has been added or changed.
"""

from __future__ import annotations

from pathlib import Path

from henon_ref.casefile.case import Case, Reading, load_case
from henon_ref.harness.table import Table
from henon_ref.text import link, markdown

CASES = Path(__file__).resolve().parents[1] / "cases"
GROUPS = {
    "": "The paper and its neighbours",
    "classic": "Classic systems with known answers",
    "scenes": "A gallery of scenes",
    "hard": "Hard cases",
}
"""Folder under ``cases/`` -> heading."""
HEADER = """\
# Cases

<!-- Made by `python docs/catalogue.py`; edit the case files, not this page. -->

Each case is one YAML file with its story, equations, source, difficulty and right result; a case with several readings
is a family of runs. *Answer* is the origin of the truth: `closed form` (all transitions, times and modes),
`first n in closed form`, `none happen` (no transitions), or `computed` (with many more digits than any solver).
For a run that cannot reach its horizon, *answer* is the status with which it must end.
"""


def catalogue() -> str:
    """The page that lists the cases, as Markdown."""
    parts = [HEADER]
    for group, heading in GROUPS.items():
        cases = [load_case(path) for path in sorted((CASES / group).glob("*.yaml"))]
        table = Table(("case", "idea", "readings", "answer", "from"), "l", [_row(case) for case in cases])
        parts.append(f"\n## {heading}\n\n{table.markdown}\n")
    return "".join(parts)


def _row(case: Case) -> tuple[str, ...]:
    assert case.path is not None  # read from a file just now
    name = f"[{case.name}]({case.path.relative_to(CASES).as_posix()})"
    return name, _idea(case), str(len(case.readings)), _origins_of_truths(case), _origin(case)


def _idea(case: Case) -> str:
    """Title and the first sentence of the story."""
    story = " ".join((case.readings[0].story or "").split())
    first, stop, _ = story.partition(". ")
    return f"**{markdown(case.title)}.** {markdown(first)}{'.' if stop else ''}".strip()


def _origins_of_truths(case: Case) -> str:
    found: dict[str, None] = {}
    for reading in case.readings:
        found[_origin_of_truth(reading)] = None
    return "; ".join(found)


def _origin_of_truth(reading: Reading) -> str:
    """How the truth of a reading is known, and how its run ends."""
    exact = reading.exact
    if reading.expect is not None and reading.expect.status != "ok":
        return f"ends `{reading.expect.status}`"
    if exact is None:
        return "computed"
    if not exact.transition_times:
        return "none happen"
    if len(exact.modes) == len(exact.transition_times):
        return "closed form"
    return f"first {len(exact.transition_times)} in closed form"


def _origin(case: Case) -> str:
    """The reports and papers that a case links to, in short."""
    links: dict[str, None] = {}
    for reading in case.readings:
        links.update(dict.fromkeys(reading.links))
    return ", ".join(f"[{markdown(_short(own))}]({own})" if link(own) == own else link(own) for own in links)


def _short(link: str) -> str:
    """``scipy#9228`` for an issue or a pull request, ``doi`` for a paper."""
    parts = link.rstrip("/").split("/")
    if "github.com" in link and len(parts) > 2 and parts[-2] in ("issues", "pull"):
        return f"{parts[-3].removesuffix('.jl')}#{parts[-1]}"
    return "doi" if "doi.org" in link else parts[2]


if __name__ == "__main__":
    (CASES / "README.md").write_text(catalogue(), encoding="utf-8")
