"""Case files, held against the solvers that there are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from henon_ref.casefile.case import Case
from henon_ref.casefile.files import read_cases
from henon_ref.harness import registry
from henon_ref.harness.campaign.plugin_probe import fixed_step


def load_cases(paths: Sequence[Path]) -> list[Case]:
    """Read the case files that paths lead to, held against the solvers that there are.

    Raises
    ------
    CaseError
        See :func:`henon_ref.casefile.files.read_cases`.
    """
    return read_cases(paths, solvers=registry.names(), fixed_step=fixed_step)
