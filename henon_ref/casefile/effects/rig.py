"""The rig with two degrees of freedom: a block on a belt coupled to a bracket (Sec. 5, Fig. 9, Eqs. 27-28).

States are dimensionless as in the paper: x1, x2 position and velocity of the block, x3, x4 angle and
angular velocity of the bracket, time in units of ``1/omega``, ``omega = sqrt((k1 + k2)/m)``; forces on the
block come in units that make ``xi1 = k2/(omega^2 m)`` their factor. The effects add up to the consistent
form ``x2' = -x1 - xi1 (xi2 (x2 + x4) + x3 + T)``; ``signs_as_printed`` turns it into Eq. (27) as printed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from henon_ref.casefile.effects.base import Body, Contact, Effect, EffectParameter, Stage
from henon_ref.casefile.effects.drives import MOVING_BELT
from henon_ref.casefile.effects.friction import STATIC_FRICTION, STRIBECK_FRICTION
from henon_ref.filippov.affine import coefficients
from henon_ref.filippov.algebra import MAX_EXPANDED, factored
from henon_ref.filippov.bounds import terms

_Values = Mapping[str, sp.Expr]


class Rig(Contact):
    """A rig under construction.

    Attributes
    ----------
    block, bracket : Expr
        Sums of the forces on the block and of the moments on the bracket over ``k2``, friction left out.
    """

    def __init__(self, values: _Values) -> None:
        self.x1, x2, self.x3, self.x4 = sp.symbols("x1:5", real=True)
        super().__init__(x2)
        self.k2 = values["k2"]
        frequency_squared = (values["k1"] + self.k2) / values["m"]
        inertia = values["m"] * (values["a"] ** 2 + values["b"] ** 2) / 3
        self.frequency = sp.sqrt(frequency_squared)
        self.block_factor = self.k2 / (frequency_squared * values["m"])
        """xi1."""
        self.bracket_factor = self.k2 * values["r"] ** 2 / (frequency_squared * inertia)
        """xi3."""
        self.block: sp.Expr = sp.Integer(0)
        self.bracket: sp.Expr = sp.Integer(0)
        self.friction_factor: sp.Expr = -self.block_factor

    @property
    def states(self) -> tuple[sp.Symbol, ...]:
        return (self.x1, self.velocity, self.x3, self.x4)

    def _linear(self, factor: sp.Expr, forces: sp.Expr) -> sp.Expr:
        """Forces with one coefficient a state, so that nothing is multiplied twice in a run."""
        # The root of omega stays out of the algebra: SymPy would take it apart.
        root = sp.Dummy()
        slopes = _slopes(forces.xreplace({self.frequency: root}), self.states)
        return sp.Add(*(factored(factor * slope).xreplace({root: self.frequency}) * x for x, slope in slopes.items()))

    def _block_acceleration(self) -> sp.Expr:
        return self._linear(self.block_factor, self.block)

    def _bracket_acceleration(self) -> sp.Expr:
        return self._linear(self.bracket_factor, self.bracket)

    def field(self) -> tuple[sp.Expr, ...]:
        block = self._block_acceleration() + self.friction_factor * self.friction
        return (self.velocity, block, self.x4, self._bracket_acceleration())

    def stuck_field(self) -> tuple[sp.Expr, ...]:
        on_belt = {self.velocity: self.belt}
        return (self.belt, self.belt_acceleration, self.x4, self._bracket_acceleration().xreplace(on_belt))

    def holding_load(self) -> sp.Expr:
        rest = self._block_acceleration().xreplace({self.velocity: self.belt})
        return (rest - self.belt_acceleration) / -self.friction_factor


def _slopes(forces: sp.Expr, states: Sequence[sp.Symbol]) -> dict[sp.Symbol, sp.Expr]:
    """Coefficients of the states in forces that are linear in them, multiplied out where they are short."""
    if terms(forces, MAX_EXPANDED) <= MAX_EXPANDED:
        forces = sp.expand(forces)
        return {x: forces.coeff(x) for x in states}
    found = coefficients(forces, states) or {}
    return {x: found.get(x, sp.S.Zero) for x in states}


def _block_spring(body: Rig, values: _Values) -> None:
    body.block += -values["stiffness"] / body.k2 * body.x1


def _coupling_spring(body: Rig, values: _Values) -> None:
    body.block += -values["stiffness"] / body.k2 * (body.x1 + body.x3)
    body.bracket += -values["stiffness"] / body.k2 * (body.x1 + body.x3)


def _bracket_spring(body: Rig, values: _Values) -> None:
    body.bracket += -values["stiffness"] / body.k2 * body.x3


def _coupling_damper(body: Rig, values: _Values) -> None:
    factor = values["coefficient"] * body.frequency / body.k2
    body.block += -factor * (body.velocity + body.x4)
    body.bracket += -factor * (body.velocity + body.x4)


def _bracket_damper(body: Rig, values: _Values) -> None:
    body.bracket += -values["coefficient"] * body.frequency / body.k2 * body.x4


def _load_coupling(body: Rig, values: _Values) -> None:
    spring = values["friction"] * values["stiffness"] / body.k2
    damper = values["friction"] * values["coefficient"] * body.frequency / body.k2
    body.normal_load += -spring * body.x3 - damper * body.x4
    body.valid.append(body.normal_load)


def _signs_as_printed(body: Rig, _: _Values) -> None:
    coupling = _slopes(body.block, (body.x3,))[body.x3]
    body.block += -2 * coupling * body.x3
    body.friction_factor = -body.friction_factor


def _stiffness(meaning: str) -> EffectParameter:
    return EffectParameter("stiffness", "N/m", meaning)


def _coefficient(meaning: str) -> EffectParameter:
    return EffectParameter("coefficient", "N s/m", meaning)


RIG_EFFECTS: tuple[Effect[Rig], ...] = (
    Effect("block_spring", "spring between block and wall", Stage.FORCE, (_stiffness("k1"),), _block_spring),
    Effect("coupling_spring", "spring between block and bracket", Stage.FORCE, (_stiffness("k2"),), _coupling_spring),
    Effect("bracket_spring", "spring between bracket and frame", Stage.FORCE, (_stiffness("k3"),), _bracket_spring),
    Effect("coupling_damper", "damper between block and bracket", Stage.FORCE, (_coefficient("c1"),), _coupling_damper),
    Effect("bracket_damper", "damper between bracket and frame", Stage.FORCE, (_coefficient("c2"),), _bracket_damper),
    Effect(
        "load_coupling",
        "the bracket's spring and damper unload the contact: y = 1 - xi6 x3 - xi7 x4, and y > 0 while it lasts",
        Stage.FORCE,
        (
            EffectParameter("friction", "1", "mu0 in xi6 and xi7"),
            _stiffness("k3 in xi6"),
            _coefficient("c2 in xi7"),
        ),
        _load_coupling,
    ),
    Effect(
        "signs_as_printed",
        "Eq. (27) to the letter: the coupling x3 and the friction drive the block",
        Stage.HOLDING,
        (),
        _signs_as_printed,
    ),
)


def _positive(name: str, unit: str, meaning: str) -> EffectParameter:
    return EffectParameter(name, unit, meaning, range="positive")


TWO_DOF_RIG: Body[Rig] = Body(
    name="two_dof_rig",
    meaning="a block on a belt coupled to a bracket (Eqs. 27-28)",
    parameters=(
        _positive("m", "kg", "mass of block and bracket"),
        _positive("k1", "N/m", "for the unit of time"),
        _positive("k2", "N/m", "for the units of time and force"),
        _positive("a", "m", "height of the bracket"),
        _positive("b", "m", "width of the bracket"),
        _positive("r", "m", "arm of the springs at the bracket"),
    ),
    make=Rig,
    effects=(*RIG_EFFECTS, MOVING_BELT, STRIBECK_FRICTION, STATIC_FRICTION),
)
