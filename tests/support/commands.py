"""The command ``compare`` with made-up solvers, truths and figures, which are fast."""

from __future__ import annotations

from fakes import Fake

from henon_ref.harness.cli import compare
from henon_ref.workers.worker import Job

SOLVERS = {"henon": Fake("henon"), "heyoka": Fake("heyoka", "misses"), "scipy-dop853": Fake("scipy-dop853")}


def drawing(reading: str) -> Job:
    """Takes the place of the figures, which take longer than all the rest."""
    return Job(_drawn, (reading,), 20.0)


def _drawn(state, reading):
    return {f"{reading}_cost.svg": b"<svg/>"}


def run(*arguments: object) -> int:
    return compare.command([str(argument) for argument in arguments])
