"""The result of a sweep: a data frame with a row a point, and the tables of ragged observations beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from henon_ref.sweeps.chunk import Tables
from henon_ref.sweeps.points import Points


class SweepTable(pd.DataFrame):
    """A row a point, in the points' order; its index is ``point``.

    Columns: the points' own, ``status``, and what was observed.

    Attributes
    ----------
    frames : mapping
        Name -> data frame of a ragged observation, whose column ``point`` says which row each of its rows belongs to.
    """

    _metadata: ClassVar[list[str]] = ["frames"]
    frames: Mapping[str, pd.DataFrame]

    @property
    def _constructor(self) -> Any:  # what is cut out of it, or computed from it, is a plain data frame
        return pd.DataFrame


def assembled(points: Points, chunks: Sequence[Tables]) -> SweepTable:
    """The chunks of a sweep, in order, as one table."""
    own = points.columns(slice(None))
    observed = [{name: column for name, column in chunk.points.items() if name not in own} for chunk in chunks]
    table = SweepTable(own | _concatenated(observed), index=pd.RangeIndex(len(points), name="point"))
    names = dict.fromkeys(name for chunk in chunks for name in chunk.ragged)
    frames = {name: pd.DataFrame(_concatenated([chunk.ragged[name] for chunk in chunks])) for name in names}
    object.__setattr__(table, "frames", frames)
    return table


def _concatenated(parts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    names = dict.fromkeys(name for part in parts for name in part)
    return {name: np.concatenate([part[name] for part in parts]) for name in names}
