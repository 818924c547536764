"""``henon_ref.baselines`` in a checkout is the folder ``baselines`` at its top; a wheel has that folder here."""

from pathlib import Path

__path__ = [str(Path(__file__).parents[2] / "baselines")]
