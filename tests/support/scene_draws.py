"""Random scenes, as case files.

A scene has 1 to 4 masses or rotors, a wall and perhaps a belt, 2 to 6 bodies together. They are joined by springs,
dampers and stops, hard and elastic, driven by smooth forces, square waves and pulses, and rub on each other, on the
wall and on the belt in 1 to 4 contacts of every law. Contacts may share a body: they form chains, stacks and loops.

A scene is the same wherever it is drawn, by its seed and number alone: :mod:`random` sees to that. (What ``hypothesis``
draws for a seed depends on the constants in all modules that are loaded.)
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal
from itertools import permutations
from random import Random

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


class Draw(Random):
    """Random choices."""

    def number(self, low: float, high: float) -> Decimal:
        """A decimal with three places; never 0."""
        return Decimal(self.randint(round(1000 * low), round(1000 * high)) or 1) / 1000

    def one_in(self, n: int) -> bool:
        """True once in n."""
        return self.randrange(n) == 0


def _friction(draw: Draw, p: str, q: str) -> str:
    law = draw.choice(["coulomb", "coulomb", "stribeck", "stribeck_exp"])
    force = draw.number(0.2, 1)
    keys = [f"law: {law}, force: {force}"]
    if law == "stribeck":
        keys.append(f"slope: {draw.number(0.2, 3)}")
    if law == "stribeck_exp":
        keys.append(f"velocity: {draw.number(0.2, 2)}")
    if draw.one_in(2):
        keys.append(f"static: {force + draw.number(0.05, 0.8)}")
    if draw.one_in(3):
        keys.append(f"viscous: {draw.number(0.01, 0.3)}")
    if draw.one_in(4):
        keys.append(f'normal: "1 + {draw.number(-0.9, 1.5)}*cos({draw.number(0.5, 3)}*t)"')
    return f"friction: {{between: [{p}, {q}], {', '.join(keys)}}}"


def _contacts(draw: Draw, movers: list[Mover], ground: list[str]) -> list[str]:
    """Friction between bodies of one kind, at most one contact a pair; in one scene of four they may form loops."""
    pairs = [(a.name, b.name) for a, b in permutations(movers, 2) if a.rotor == b.rotor]
    pairs += [(a.name, q) for a in movers for q in ground]
    drawn = {frozenset(pair): pair for pair in draw.sample(pairs, min(draw.randint(1, 4), len(pairs)))}.values()
    loops, found, joined = draw.one_in(4), [], {name: {name} for name in [*(m.name for m in movers), *ground]}
    for p, q in drawn:
        if loops or q not in joined[p]:
            both = joined[p] | joined[q]
            joined.update(dict.fromkeys(both, both))
            found.append(_friction(draw, p, q))
    return found


def _stop(draw: Draw, movers: list[Mover]) -> str:
    """A stop of a body against the wall or another body, which it is before, at, or (if elastic) beyond."""
    p = draw.choice(movers)
    others = [q for q in movers if q is not p and q.rotor == p.rotor]
    q = draw.choice([None, None, *others])
    ends, way = [p.name, "wall" if q is None else q.name], draw.choice([1, -1])
    distance = way * (p.position - (q.position if q else 0))
    parting = way * (p.velocity - (q.velocity if q else 0)) >= 0  # a start that moves into a hard stop is refused
    if draw.one_in(2):
        away = Decimal(0) if parting and draw.one_in(4) else draw.number(0.05, 1)
        how = f"restitution: {draw.choice(['0', '1', *3 * [str(draw.number(0.05, 0.95))]])}"
    else:
        away = draw.number(-0.2, 1)
        how = f"stiffness: {draw.number(5, 60)}"
        if draw.one_in(2):
            how += f", damping: {draw.number(0.1, 3)}"
    return f"stop: {{between: [{', '.join(ends[::way])}], gap: {distance - away}, {how}}}"


def _force(draw: Draw, on: Mover) -> str:
    size, rate, phase = draw.number(0.3, 2), draw.number(0.4, 4), draw.number(0.1, 3)
    wave = {
        "harmonic": f"{size}*cos({rate}*t + {phase})",
        "square": f"{size}*sign(sin({rate}*t + {phase}))",
        "rectified": f"{size}*max(0, sin({rate}*t + {phase}))",
        "pulse": f"piecewise({size}, t < {phase}, {-size / 2})",
    }[draw.choice([*5 * ["harmonic"], "square", "rectified", "pulse"])]
    return f'{"torque" if on.rotor else "force"}: {{on: {on.name}, value: "{wave}"}}'


def _joints(draw: Draw, movers: list[Mover], belt: str) -> list[str]:
    """Springs, dampers and forces of every body."""
    found = []
    for i, m in enumerate(movers):
        cubic = f", cubic: {draw.number(0.05, 0.5)}" if draw.one_in(3) else ""
        to = "belt" if belt == "shaken" and draw.one_in(4) else "wall"
        found.append(f"spring: {{between: [{m.name}, {to}], stiffness: {draw.number(0.3, 3)}{cubic}}}")
        if i and m.rotor == movers[i - 1].rotor and draw.one_in(2):
            ends = f"[{m.name}, {movers[i - 1].name}]"
            found.append(f"spring: {{between: {ends}, stiffness: {draw.number(0.2, 2)}}}")
        if draw.one_in(3):
            found.append(f"damper: {{between: [{m.name}, wall], coefficient: {draw.number(0.02, 0.4)}}}")
        if draw.one_in(2):
            found.append(_force(draw, m))
    return found


def _movers(draw: Draw, belt_velocity: Decimal) -> list[Mover]:
    """1 to 4 bodies; some start at rest, on the belt, or at the velocity of the one before."""
    count, kinds = draw.randint(1, 4), draw.choice([*5 * ["masses"], "rotors", "both"])
    found: list[Mover] = []
    for i, name in enumerate("abcd"[:count]):
        rest = [Decimal(0), belt_velocity, found[-1].velocity if found else Decimal(0)]
        velocity = draw.choice(rest) if draw.one_in(4) else draw.number(-2, 2)
        rotor = kinds == "rotors" or (kinds == "both" and i == count - 1)
        found.append(Mover(name, rotor, draw.number(-1.5, 1.5), velocity))
    return found


def scene(seed: int, number: int) -> str:
    """A case file: one of a seed's scenes."""
    draw = Draw(f"{seed} {number}")
    belt, speed = draw.choice(["steady", "steady", "shaken", "none"]), draw.number(-0.8, 0.8)
    movers = _movers(draw, speed if belt == "steady" else Decimal(0))
    bodies = [f"{m.name}: {{{'inertia' if m.rotor else 'mass'}: {draw.number(0.5, 2)}}}" for m in movers]
    if belt == "steady":
        bodies.append(f"belt: {{velocity: {speed}}}")
    if belt == "shaken":
        bodies.append(f"belt: {{position: {speed}*sin({draw.number(0.5, 4)}*t)}}")
    bodies.append("wall: fixed")
    ground = ["wall", *(["belt"] if belt != "none" else [])]
    connections = _joints(draw, movers, belt) + _contacts(draw, movers, ground)
    stops = [_stop(draw, movers) for _ in range(draw.randint(0, 2))]
    kept = {one.split("]")[0]: one for one in stops}  # two stops between the same bodies in one order would need names
    lines = ["schema: 1", "name: random_scene", "title: A random scene", "scene:", "  bodies:"]
    lines += [f"    {one}" for one in bodies] + ["  connections:"]
    lines += [f"    - {one}" for one in [*connections, *kept.values()]]
    lines += [f"initial: {{{', '.join(m.states for m in movers)}}}", f"until: {HORIZON}", ""]
    return "\n".join(lines)
