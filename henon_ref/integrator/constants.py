"""Constants of compiled modes at given parameter values, made in microseconds, and what decides modes with them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.integrator.compiled_modes import CompiledModes, GrowingRows
from henon_ref.integrator.pairs import Pair, Three, three_of
from henon_ref.integrator.parameter_programs import LoopData, ParameterPrograms, loop_data, numbers_behind
from henon_ref.jit.processor_time import compiling
from henon_ref.kernel.shared import kernel
from henon_ref.precision import one_at_a_time

if TYPE_CHECKING:
    from henon_ref.integrator.jump import Jumps
    from henon_ref.integrator.precise_modes import PreciseModes
    from henon_ref.modes.mode_evaluation import ModeEvaluation


class ModeConstants:
    """A system's compiled modes at given parameter values: programs in double-double give their constants.

    Parameters
    ----------
    programs : ParameterPrograms
    values : tuple of Three
        Of the programs' parameters, in their order (see :mod:`henon_ref.integrator.pairs`).
    exact : callable
        Gives them as exact numbers, for what double-double does not decide.

    Attributes
    ----------
    table : ModeTable
    latest : LoopData
        For the modes that were compiled when it was last asked for; replaced as a whole by :meth:`update`.
    doubles : tuple of float
        The values, each rounded to double.
    no_zeros : tuple of int
        Known zeros of the guards, as many as the largest mode has, where a start is off every surface.
    is_finite : bool
        Whether the constants of all modes that were compiled first are.
    """

    def __init__(
        self, programs: ParameterPrograms, values: tuple[Three, ...], exact: Callable[[], Sequence[sp.Expr]]
    ) -> None:
        self.programs, self.table, self.values, self.exact = programs, programs.table, values, exact
        self.no_zeros = programs.no_zeros
        self.doubles = tuple([high for high, _, _ in values])
        made = self._at_once = programs.at_once(values)
        self.latest = self._extended(self.table.compiled) if made is None else made
        self.is_finite = made is not None or bool(np.isfinite(self.latest.numbers).all())

    @cached_property
    def _values(self) -> NDArray[np.float64]:
        """See :class:`henon_ref.integrator.compiled_modes.DistinctConstants`."""
        return np.zeros(1) if self._at_once is None else numbers_behind(self._at_once)

    @cached_property
    def _rows(self) -> GrowingRows:
        """The modes' rows of constants."""
        return GrowingRows(np.float64, (0, 0))

    def update(self) -> LoopData:
        """Take in modes that have been compiled since."""
        with one_at_a_time(), compiling():
            compiled = self.table.compiled
            if self.latest.compiled is not compiled:
                self.latest = self._extended(compiled)
            return self.latest

    def _extended(self, compiled: CompiledModes) -> LoopData:
        known = len(self._values) // 2
        if compiled.constants > known:
            new = self._pairs(self.table.constants.expressions[known : compiled.constants])
            self._values = np.concatenate([self._values, new])
        if len(compiled.sources) > len(self._rows):
            self._rows.extend(self._values[compiled.sources[len(self._rows) :]])
        return loop_data(self.table, compiled, self._rows.rows, self._normals)

    @cached_property
    def _normals(self) -> NDArray[np.float64]:
        """Constants of the normal velocities of all surfaces, in states and signs."""
        made = self.table.normals
        pairs = self._pairs(() if made is None else made.tape.constants).reshape(-1, 2)
        return np.concatenate([pairs[:, 0], pairs[:, 1], [0.0]])

    def _pairs(self, expressions: Sequence[sp.Expr]) -> NDArray[np.float64]:
        """Constants in parameters, each as its double and what that leaves, shape (2 k,); NaN for one that is none."""
        program = self.programs.program(tuple(expressions))
        return program.pairs(np.array(self.values).reshape(1, -1, 3), lambda _: self.exact())[0]

    def signs(self, t: Pair, x: Sequence[Pair]) -> Sequence[int]:
        """Signs of the surfaces, then of the ``valid`` expressions, at a point; UNCLEAR_SIGN where one is not clear.

        By a bound in doubles where all of them are short sums of products, else by one in double-double.
        """
        in_doubles = self.programs.signs_in_doubles
        if in_doubles is not None:
            return in_doubles(t[0], *[high for high, _ in x], *self.doubles) or (kernel.UNCLEAR_SIGN,)
        point = np.array([[*(three_of(pair) for pair in (t, *x)), *self.values]])
        signs: list[int] = self.programs.start_signs(point)[0].tolist()
        return signs

    def exact_signs(self, point: Sequence[Any]) -> list[int | None]:
        """The same at a point of exact numbers; None where there is no value (see :meth:`ConstantProgram.signs`)."""
        return self.programs.start.signs((*point, *self.exact()))

    @cached_property
    def in_doubles(self) -> ModeEvaluation:
        """The modes in double precision."""
        return self.programs.shared_tapes.in_doubles(self.doubles)

    @cached_property
    def precise(self) -> PreciseModes:
        """The modes in multiprecision."""
        from henon_ref.integrator.precise_modes import PreciseModes  # most runs have no use for it

        shared, values = self.programs.shared_tapes, tuple(self.exact())
        return PreciseModes(self.programs.system, self.in_doubles, lambda: shared.in_balls(values))

    @cached_property
    def jumps(self) -> Jumps:
        """The resets' maps, in multiprecision."""
        from henon_ref.integrator.jump import Jumps

        return Jumps(self.precise)
