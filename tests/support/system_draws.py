"""Random Filippov systems, as case files.

A system has 1-3 surfaces and 2-6 states; its field is made of linear and cubic damping, sines of states, products of
states, harmonic drives and signs (some of them times a state); cubic damping keeps it bounded.
"""

from __future__ import annotations

from scene_draws import Draw


def _component(draw: Draw, state: str, states: list[str], signs: list[str], friction: str | None) -> str:
    terms = [f"-({draw.number(0.05, 0.6)})*{state}", f"-({draw.number(0.05, 0.5)})*{state}^3"]
    for _ in range(draw.randint(1, 2)):
        kind, one = draw.choice(["sine", "linear", "product"]), draw.choice(states)
        factor = draw.number(-1.5, 1.5) if kind != "product" else draw.number(-0.2, 0.2)
        part = {"sine": f"sin({one})", "linear": one, "product": f"{one}*{draw.choice(states)}"}[kind]
        terms.append(f"({factor})*{part}")
    if draw.one_in(2):
        terms.append(f"({draw.number(-2, 2)})*cos(({draw.number(0.3, 4)})*t + ({draw.number(-3, 3)}))")
    for sign in signs:
        if draw.one_in(2):
            scale = f"*(1 + ({draw.number(-0.3, 0.3)})*{draw.choice(states)})" if draw.one_in(2) else ""
            terms.append(f"({draw.number(-1.5, 0.7)})*{sign}{scale}")
    if friction:  # a surface that attracts, so that there are sticks, several at once, and releases
        terms.append(f"({draw.number(-2.5, -0.6)})*{friction}")
    return " + ".join(terms)


def _surface(draw: Draw, index: int, states: list[str]) -> str:
    here, other, away = states[index], draw.choice(states), f"({draw.number(-0.8, 0.8)})"
    return {
        "plane": f"{here} + {away}",
        "moving": f"{here} + {away}*sin(({draw.number(0.3, 3)})*t)",
        "curved": f"{here} + ({draw.number(-0.4, 0.4)})*{other}^2 + {away}",
        "circle": f"{here}^2 + ({draw.number(0.3, 1.5)})*{states[index - 1]}^2 - {draw.number(0.2, 1.5)}",
    }[draw.choice(["plane", "plane", "moving", "curved", "circle"])]


def system(seed: int, number: int) -> str:
    """A case file: one of a seed's systems."""
    draw = Draw(f"systems {seed} {number}")
    surfaces = draw.randint(1, 3)
    states, signs = list("xyzpqr"[: draw.randint(max(2, surfaces), 6)]), list("suw"[:surfaces])
    sticky = draw.one_in(2)
    lines = ["schema: 1", "name: random_system", "title: A random system", "system:"]
    lines += [f"  state: [{', '.join(states)}]", "  surfaces:"]
    lines += [f'    {sign}: "{_surface(draw, i, states)}"' for i, sign in enumerate(signs)]
    lines += ["  field:"]
    for i, state in enumerate(states):
        friction = signs[i] if sticky and i < surfaces else None
        lines.append(f'    - "{_component(draw, state, states, signs, friction)}"')
    lines += ["initial: {" + ", ".join(f"{state}: {draw.number(-2, 2)}" for state in states) + "}", "until: 12", ""]
    return "\n".join(lines)
