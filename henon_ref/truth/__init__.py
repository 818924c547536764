"""Truth: every transition of a reading to far more digits than any solver has, proven where that is possible."""

from henon_ref.truth.reference import ReferenceTransition, Truth, TruthError
from henon_ref.truth.settle import truth_for

__all__ = ["ReferenceTransition", "Truth", "TruthError", "truth_for"]
