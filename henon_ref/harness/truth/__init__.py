"""Truth: every transition of a reading, far more accurate than any solver, and proven if possible."""

from henon_ref.harness.truth.reference import ReferenceTransition, Truth, TruthError

__all__ = ["ReferenceTransition", "Truth", "TruthError"]
