"""Causes of failures of the baselines, each demonstrated by a minimal run of the library alone.

The check of a cause is a short function that uses only the library: it sets up the smallest problem that shows the
behaviour, runs the library, and raises :class:`ClaimError` if the library does not behave as claimed. The tests run all
checks, reports print their results, and :mod:`henon_ref.harness.campaign.causes` assigns causes to failed runs.
"""

from __future__ import annotations

from henon_ref.baselines.causes import (  # noqa: F401 - each module adds to CAUSES
    by_program,
    diffrax_events,
    diffsol_events,
    heyoka_events,
    nosnoc_grid,
    scipy_events,
    sundials_events,
)
from henon_ref.baselines.causes.base import CAUSES, Cause, ClaimError

__all__ = ["CAUSES", "Cause", "ClaimError"]
