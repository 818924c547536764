"""Truth: every transition of a reading to far more digits than any solver has, proven where that is possible."""

from henon_ref.harness.truth.compute import truth_for
from henon_ref.harness.truth.reference import ReferenceTransition, Truth, TruthError

__all__ = ["ReferenceTransition", "Truth", "TruthError", "truth_for"]
