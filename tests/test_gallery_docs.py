"""The gallery's pages say what the case files and their stored truths say, and each scene has its picture."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest
from shipped import proven, read

DOCS = Path(__file__).parent.parent / "docs"
LARGEST = 500_000
"""Of all pictures together [bytes]."""


@pytest.fixture(scope="module")
def gallery() -> ModuleType:
    spec = importlib.util.spec_from_file_location("gallery", DOCS / "gallery.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.load_case = read
    return module


def test_pages_are_made_from_cases_and_truths(gallery: ModuleType) -> None:
    written = [DOCS / "gallery.md", *(DOCS / "gallery").glob("*.md")]
    texts = {path.relative_to(DOCS).as_posix(): path.read_text(encoding="utf-8") for path in written}
    assert texts == gallery.pages(), "run python docs/gallery.py"


def test_each_scene_has_its_picture(gallery: ModuleType) -> None:
    pictures = {path.stem: path for path in (DOCS / "gallery").glob("*.svg")}
    assert set(pictures) == {case.name for case in gallery.cases()}
    assert sum(path.stat().st_size for path in pictures.values()) < LARGEST
    assert all("<title" in path.read_text(encoding="utf-8") for path in pictures.values())


def test_times_that_a_story_calls_proven_are_those_of_the_stored_truth(gallery: ModuleType) -> None:
    checked = 0
    for case in gallery.cases():
        for reading in case.readings:
            named = re.findall(r"proven (?:are|is) ([\d.]+)(?: and ([\d.]+))?", " ".join((reading.story or "").split()))
            for digits in (own.rstrip(".") for pair in named for own in pair if own):
                expected = proven(case, reading)
                decimals = len(digits.partition(".")[2])
                assert digits in {f"{event.time:.{decimals}f}" for event in expected.transitions}
                checked += 1
    assert checked >= 3
