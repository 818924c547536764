"""The gallery: ``docs/gallery.md`` and a page and a picture a scene in ``docs/gallery/``, from case files and truths.

Run ``python docs/gallery.py`` after a scene or its truth has changed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from henon_ref.casefile.case import Case, Reading, load_case
from henon_ref.figures.motion import draw_portrait
from henon_ref.harness.report.svg import svg
from henon_ref.harness.table import Table
from henon_ref.harness.truth.compute import stored_truth
from henon_ref.simulation.simulate import simulate
from henon_ref.simulation.system import System
from henon_ref.text import markdown

DOCS = Path(__file__).resolve().parent
SCENES = DOCS.parent / "cases" / "scenes"
SHOWN = 6
"""Transitions of a reading that the page shows."""
POINTS = 400
"""Points of a curve in a picture."""
PLANES = {"burridge_knopoff": ("x_b34", "v_b34")}
"""States that a picture shows, where they are not those that a report would: the block that slips first."""
_NEXT_EQUATION = re.compile(r"[,;] (?=[^,;()=]*(?:=|->))")
HEADER = """\
# A gallery of scenes

<!-- Made by `python docs/gallery.py`; edit the case files in cases/scenes, not this page. -->

Well-known models of machines with friction and stops. Each page has the equations, their source and that of the
parameters, and the proven times of the first transitions (`henon-ref truth`). `henon-ref compare scenes` runs all of
them.
"""
NOTE = """\
*Source not at hand* says that the text was not open when the scene was written: nothing is quoted from it.
"""


def cases() -> list[Case]:
    """The scenes, in the order of the gallery."""
    return [load_case(path) for path in sorted(SCENES.glob("*.yaml"))]


def pages() -> dict[str, str]:
    """The gallery's pages as Markdown: the path of each below ``docs/``, and its text."""
    scenes = {f"gallery/{case.name}": case for case in cases()}
    cards = [f"[![]({page}.svg) {markdown(case.title)}]({page}.md)" for page, case in scenes.items()]
    contents = ["```{toctree}", ":hidden:", "", *scenes, "```"]
    first = "\n\n".join([HEADER, ":::{container} cards", *cards, ":::\n"]) + "\n" + "\n".join(contents) + "\n"
    return {"gallery.md": first, **{f"{page}.md": "".join(_scene(case)) for page, case in scenes.items()}}


def _scene(case: Case) -> Iterator[str]:
    first = case.readings[0]
    yield f"# {markdown(case.title)}\n\n<!-- Made by `python docs/gallery.py`. -->\n\n"
    yield f"![Phase portrait of {case.name}]({case.name}.svg)\n\n{_text(first.story)}\n\n"
    yield "    " + _NEXT_EQUATION.sub("\n    ", _text(first.equations)) + "\n\n"
    yield f"*Case file:* [`scenes/{case.name}`](../../cases/scenes/{case.name}.yaml), simulated by "
    yield f"`henon-ref simulate scenes/{case.name}`, compared by `henon-ref compare scenes/{case.name}`."
    yield f"\n\n*Source.* {markdown(_text(first.source))}\n"
    if "not at hand" in (first.source or ""):
        yield f"\n{NOTE}"
    yield "\n## Transitions\n"
    for reading in case.readings:
        if len(case.readings) > 1:
            own = _text(reading.story) if reading.story != first.story else ""
            yield f"\n### {markdown(reading.title)}\n" + (f"\n{own}\n" if own else "")
        yield from _table(case, reading)


def _table(case: Case, reading: Reading) -> Iterator[str]:
    truth = stored_truth(case, reading)
    if truth is None:
        raise SystemExit(f"{case.name}, {reading.name}: no truth is stored; run henon-ref truth {case.path}")
    found = truth.transitions
    if not found:
        yield "\nNo transition happens.\n"
        return
    names = [sign.name for sign in reading.problem.system.signs]
    rows = [(f"{event.time:.12f}", event.kind, f"`{names[event.surface]}`") for event in found[:SHOWN]]
    yield f"\n{Table(('time [s]', 'what', 'surface'), 'rl', rows).markdown}\n"
    if len(found) > SHOWN:
        yield f"\nand {len(found) - SHOWN} more.\n"


def _text(value: str | None) -> str:
    return " ".join((value or "").split())


def picture(case: Case) -> str:
    """The phase portrait of a case's first reading as SVG."""
    reading = case.readings[0]
    system = System.from_case(case.path or "", reading.name)
    run = simulate(system, system.initial, until=system.until, start=system.start, mode=system.mode)
    names = reading.problem.system.state_names
    pair = tuple(names.index(name) for name in PLANES.get(case.name, ()))
    figure = draw_portrait(reading.problem.system, run.motion(POINTS), (pair[0], pair[1]) if pair else None)
    assert figure is not None  # a scene has two states and more
    return svg(figure).decode()


def main() -> None:
    """Write the pages and their pictures."""
    (DOCS / "gallery").mkdir(exist_ok=True)
    for case in cases():
        (DOCS / "gallery" / f"{case.name}.svg").write_text(picture(case), encoding="utf-8")
    for path, text in pages().items():
        (DOCS / path).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
