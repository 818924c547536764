"""What the paper says, and what became of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

Verdict = Literal["reproduced", "corrected", "not reproducible", "fails"]


@dataclass(frozen=True)
class Claim:
    """One number, equation, figure or statement of the paper."""

    where: str
    """Its place: ``Eq. (9)``, ``Fig. 4``, ``Sec. 4.2``."""
    says: str
    """What is printed there, in short."""
    verdict: Verdict
    how: str
    """The evidence; for ``corrected`` what it has to be, for ``not reproducible`` what is missing."""


@dataclass(frozen=True)
class Section:
    """A part of the page."""

    title: str
    text: str
    """Markdown, with links to figures in the page's folder."""
    claims: tuple[Claim, ...]


def checked(where: str, says: str, holds: object, how: str, *, corrected: bool = False) -> Claim:
    """A claim whose verdict hangs on a check made now: ``fails`` where the check does not hold."""
    verdict: Verdict = "fails" if not holds else "corrected" if corrected else "reproduced"
    return Claim(where, says, verdict, how)


def picture(folder: Path, name: str, caption: str) -> str:
    """Markdown for a figure that has been saved in the page's folder.

    Raises
    ------
    FileNotFoundError
        If it has not.
    """
    if not (folder / name).is_file():
        raise FileNotFoundError(f"{folder / name} has not been drawn")
    return f"![{caption}]({name})\n\n*{caption}*\n"
