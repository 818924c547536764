"""Causes of the baselines' failures, each shown by a minimal run of the library alone.

A cause is a short function that uses nothing of this project: it sets up the smallest problem that shows the
behaviour, runs the library, and raises :class:`ClaimError` if it does not behave as claimed. The tests run them all,
reports run them and print what they say, and :mod:`henon_ref.harness.campaign.causes` decides which failing run each
explains.
"""

from __future__ import annotations

from henon_ref.baselines.causes.base import Cause, ClaimError
from henon_ref.baselines.causes.cvode_c_events import CVODE_C
from henon_ref.baselines.causes.diffrax_events import DIFFRAX
from henon_ref.baselines.causes.diffsol_events import DIFFSOL
from henon_ref.baselines.causes.heyoka_events import HEYOKA
from henon_ref.baselines.causes.naive import NAIVE
from henon_ref.baselines.causes.nosnoc_grid import NOSNOC
from henon_ref.baselines.causes.octave_events import OCTAVE
from henon_ref.baselines.causes.scipy_events import SCIPY
from henon_ref.baselines.causes.siconos_step import SICONOS
from henon_ref.baselines.causes.sundials_events import SUNDIALS

ALL = (*SCIPY, *SUNDIALS, *CVODE_C, *OCTAVE, *SICONOS, *HEYOKA, *DIFFRAX, *DIFFSOL, *NOSNOC, *NAIVE)
CAUSES: dict[str, Cause] = {cause.name: cause for cause in ALL}

__all__ = ["CAUSES", "Cause", "ClaimError"]
