"""Random scenes, as case files.

A scene has 1 to 4 masses or rotors, a wall and perhaps a belt, 2 to 6 bodies together. They are joined by springs,
dampers and stops, hard and elastic, driven by smooth forces, square waves and pulses, and rub on each other, on the
wall and on the belt in 1 to 4 contacts of every law. Contacts may share a body: they form chains, stacks and loops.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal
from itertools import permutations

from hypothesis import strategies as st

HORIZON = 4
"""[s]."""


@dataclass(frozen=True)
class Mover:
    """A mass or a rotor, and where it starts."""

    name: str
    rotor: bool
    position: Decimal
    velocity: Decimal

    @property
    def states(self) -> str:
        """The initial values of its states."""
        position, velocity = ("phi", "omega") if self.rotor else ("x", "v")
        return f"{position}_{self.name}: {self.position}, {velocity}_{self.name}: {self.velocity}"


def _number(low: float, high: float) -> st.SearchStrategy[Decimal]:
    """A decimal with three places; never 0."""
    return st.integers(round(1000 * low), round(1000 * high)).filter(bool).map(lambda n: Decimal(n) / 1000)


def _one_in(n: int) -> st.SearchStrategy[bool]:
    return st.integers(1, n).map(lambda k: k == n)


@st.composite
def _friction(draw: st.DrawFn, p: str, q: str) -> str:
    law = draw(st.sampled_from(["coulomb", "coulomb", "stribeck", "stribeck_exp"]))
    force = draw(_number(0.2, 1))
    keys = [f"law: {law}, force: {force}"]
    if law == "stribeck":
        keys.append(f"slope: {draw(_number(0.2, 3))}")
    if law == "stribeck_exp":
        keys.append(f"velocity: {draw(_number(0.2, 2))}")
    if draw(st.booleans()):
        keys.append(f"static: {force + draw(_number(0.05, 0.8))}")
    if draw(_one_in(3)):
        keys.append(f"viscous: {draw(_number(0.01, 0.3))}")
    if draw(_one_in(4)):
        keys.append(f'normal: "1 + {draw(_number(-0.9, 1.5))}*cos({draw(_number(0.5, 3))}*t)"')
    return f"friction: {{between: [{p}, {q}], {', '.join(keys)}}}"


@st.composite
def _contacts(draw: st.DrawFn, movers: list[Mover], ground: list[str]) -> list[str]:
    """Friction between bodies of one kind, at most one contact a pair; in one scene of four they may form loops."""
    pairs = [(a.name, b.name) for a, b in permutations(movers, 2) if a.rotor == b.rotor]
    pairs += [(a.name, q) for a in movers for q in ground]
    drawn = draw(st.lists(st.sampled_from(pairs), min_size=1, max_size=4, unique_by=frozenset))
    loops, found, joined = draw(_one_in(4)), [], {name: {name} for name in [*(m.name for m in movers), *ground]}
    for p, q in drawn:
        if loops or q not in joined[p]:
            both = joined[p] | joined[q]
            joined.update(dict.fromkeys(both, both))
            found.append(draw(_friction(p, q)))
    return found


@st.composite
def _stop(draw: st.DrawFn, movers: list[Mover]) -> str:
    """A stop of a body against the wall or another body, which it is before, at, or (if elastic) beyond."""
    p = draw(st.sampled_from(movers))
    others = [q for q in movers if q is not p and q.rotor == p.rotor]
    q = draw(st.sampled_from([None, None, *others]))
    ends, way = [p.name, "wall" if q is None else q.name], draw(st.sampled_from([1, -1]))
    distance = way * (p.position - (q.position if q else 0))
    parting = way * (p.velocity - (q.velocity if q else 0)) >= 0  # a start that moves into a hard stop is refused
    if draw(st.booleans()):
        away = Decimal(0) if parting and draw(_one_in(4)) else draw(_number(0.05, 1))
        how = f"restitution: {draw(st.sampled_from(['0', '1', *3 * [str(draw(_number(0.05, 0.95)))]]))}"
    else:
        away = draw(_number(-0.2, 1))
        how = f"stiffness: {draw(_number(5, 60))}"
        if draw(st.booleans()):
            how += f", damping: {draw(_number(0.1, 3))}"
    return f"stop: {{between: [{', '.join(ends[::way])}], gap: {distance - away}, {how}}}"


@st.composite
def _force(draw: st.DrawFn, on: Mover) -> str:
    size, rate, phase = draw(_number(0.3, 2)), draw(_number(0.4, 4)), draw(_number(0.1, 3))
    wave = {
        "harmonic": f"{size}*cos({rate}*t + {phase})",
        "square": f"{size}*sign(sin({rate}*t + {phase}))",
        "rectified": f"{size}*max(0, sin({rate}*t + {phase}))",
        "pulse": f"piecewise({size}, t < {phase}, {-size / 2})",
    }[draw(st.sampled_from([*5 * ["harmonic"], "square", "rectified", "pulse"]))]
    return f'{"torque" if on.rotor else "force"}: {{on: {on.name}, value: "{wave}"}}'


@st.composite
def _joints(draw: st.DrawFn, movers: list[Mover], belt: str) -> list[str]:
    """Springs, dampers and forces of every body."""
    found = []
    for i, m in enumerate(movers):
        cubic = f", cubic: {draw(_number(0.05, 0.5))}" if draw(_one_in(3)) else ""
        to = "belt" if belt == "shaken" and draw(_one_in(4)) else "wall"
        found.append(f"spring: {{between: [{m.name}, {to}], stiffness: {draw(_number(0.3, 3))}{cubic}}}")
        if i and m.rotor == movers[i - 1].rotor and draw(st.booleans()):
            ends = f"[{m.name}, {movers[i - 1].name}]"
            found.append(f"spring: {{between: {ends}, stiffness: {draw(_number(0.2, 2))}}}")
        if draw(_one_in(3)):
            found.append(f"damper: {{between: [{m.name}, wall], coefficient: {draw(_number(0.02, 0.4))}}}")
        if draw(st.booleans()):
            found.append(draw(_force(m)))
    return found


@st.composite
def _movers(draw: st.DrawFn, belt_velocity: Decimal) -> list[Mover]:
    """1 to 4 bodies; some start at rest, on the belt, or at the velocity of the one before."""
    count, kinds = draw(st.integers(1, 4)), draw(st.sampled_from([*5 * ["masses"], "rotors", "both"]))
    found: list[Mover] = []
    for i, name in enumerate("abcd"[:count]):
        rest = [Decimal(0), belt_velocity, found[-1].velocity if found else Decimal(0)]
        velocity = draw(st.sampled_from(rest)) if draw(_one_in(4)) else draw(_number(-2, 2))
        rotor = kinds == "rotors" or (kinds == "both" and i == count - 1)
        found.append(Mover(name, rotor, draw(_number(-1.5, 1.5)), velocity))
    return found


@st.composite
def scenes(draw: st.DrawFn) -> str:
    """A case file of one scene."""
    belt, speed = draw(st.sampled_from(["steady", "steady", "shaken", "none"])), draw(_number(-0.8, 0.8))
    movers = draw(_movers(speed if belt == "steady" else Decimal(0)))
    bodies = [f"{m.name}: {{{'inertia' if m.rotor else 'mass'}: {draw(_number(0.5, 2))}}}" for m in movers]
    if belt == "steady":
        bodies.append(f"belt: {{velocity: {speed}}}")
    if belt == "shaken":
        bodies.append(f"belt: {{position: {speed}*sin({draw(_number(0.5, 4))}*t)}}")
    bodies.append("wall: fixed")
    ground = ["wall", *(["belt"] if belt != "none" else [])]
    connections = draw(_joints(movers, belt)) + draw(_contacts(movers, ground))
    stops = [draw(_stop(movers)) for _ in range(draw(st.integers(0, 2)))]
    kept = {one.split("]")[0]: one for one in stops}  # two stops between the same bodies in one order would need names
    lines = ["schema: 1", "name: random_scene", "title: A random scene", "scene:", "  bodies:"]
    lines += [f"    {one}" for one in bodies] + ["  connections:"]
    lines += [f"    - {one}" for one in [*connections, *kept.values()]]
    lines += [f"initial: {{{', '.join(m.states for m in movers)}}}", f"until: {HORIZON}", ""]
    return "\n".join(lines)
