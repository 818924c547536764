"""Causes of the baselines' failures, each shown by a minimal run of the library alone.

A cause is a short function that uses nothing of this project: it sets up the smallest problem that shows the
behaviour, runs the library, and raises :class:`ClaimError` if it does not behave as claimed. The tests run them all,
reports run them and print what they say, and :mod:`henon_ref.harness.campaign.causes` decides which failing run each
explains.
"""

from __future__ import annotations

from henon_ref.baselines.causes import (  # noqa: F401 - each adds its causes
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
