"""Tapes that several modes share: their constants tell the modes apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import sympy as sp

from henon_ref.filippov.modes import Mode
from henon_ref.taylor.tape import Tape


@dataclass(frozen=True, eq=False)
class ModeTape:
    """A tape that several modes share, which the symbols of each surface's entry make that of one mode."""

    tape: Tape
    entries: tuple[tuple[Mapping[sp.Symbol, sp.Expr], ...], ...]
    """For every surface what its entry -1, 0 or +1 (in this order) puts for its symbols."""

    @cached_property
    def owners(self) -> tuple[tuple[int, ...], ...]:
        """Surfaces whose symbols stand in each constant."""
        owner = {symbol: i for i, entries in enumerate(self.entries) for symbol in entries[0]}
        found = ({owner[s] for s in c.free_symbols if s in owner} for c in self.tape.constants)
        return tuple(tuple(sorted(surfaces)) for surfaces in found)

    def constant(self, at: int, mode: Mode) -> sp.Expr:
        """A constant in a mode, in parameters."""
        values: dict[sp.Symbol, sp.Expr] = {}
        for i in self.owners[at]:
            values |= self.entries[i][mode[i] + 1]
        return self.tape.constants[at].xreplace(values)
