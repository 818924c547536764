"""Equations of all modes of contacts that act on each other, in one set.

For contacts of bodies in a row, with dry friction, each surface h_i is a relative velocity, and each contact acts on
the states by one force q_i, so ``x' = f(t, x) + C q`` and ``h' = a(t, x) + W q`` with constant matrices C and W. A
contact that slips has its friction force T_i(t, x, s_i); a contact that holds has the force that keeps its surface.
With the switches ``slip_i`` and ``slide_i``, one equal to 1 and the other to 0, both are row i of one linear system,

    slip_i q_i + slide_i (W q)_i = slip_i T_i - slide_i a_i.

The system is solved by elimination within the Taylor recurrences: its matrix is constant, so once per step, with a few
operations per contact if the bodies are in a row. No pivot vanishes, whichever contacts hold: W is symmetric and
definite up to factors of its columns (the units of the forces), so every Schur complement is the inverse inertia of
some bodies held together. A new mode therefore needs no derivation or compilation; a chain of n contacts has 3^n modes.

Each contact's surface determines a state of its own (bodies and contacts form a forest, without loops). While the
contact holds, the rate of this state is that of the bodies to which it is held, so the surface is kept exactly.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.expressions.algebra import cancelled
from henon_ref.expressions.bounds import put
from henon_ref.modes.decoupled_contacts import (
    Contact,
    SwitchedEquations,
    acting_rows,
    common_to_all,
    entries_of,
    is_crossed,
)
from henon_ref.modes.equations import Guard, along
from henon_ref.modes.switched_field import SwitchedField
from henon_ref.taylor.tape import TIME

Row = dict[int, sp.Expr]
"""Contact -> entry in its column; zeros are left out."""


@dataclass(frozen=True)
class Forces:
    """Action of the contact forces, each in the unit of its term in the first rate that contains it."""

    free: tuple[sp.Expr, ...]
    """x' without contact forces."""
    friction: tuple[sp.Expr, ...]
    """T_i: force of each contact in slip, with its sign."""
    shares: tuple[Row, ...]
    """C: one row per state."""
    slopes: tuple[Row, ...]
    """W: one row per contact."""


def coupled_equations(system: SwitchedField) -> SwitchedEquations | None:
    """Return one set of equations for all modes of contacts that act on each other; None for other systems."""
    acting = acting_rows(system)
    slid = [i for i, sign in enumerate(system.signs) if not is_crossed(system, i, acting[sign])]
    if not slid or len(system.surfaces) > 64 or not all(_ends_known(system, i) for i in slid):
        return None
    signs, surfaces = ([part[i] for i in slid] for part in (system.signs, system.surfaces))
    own_field = SwitchedField(system.states, tuple(signs), tuple(surfaces), system.field, system.parameters)
    try:
        own, forces = _own_states(own_field), _forces(own_field)
        beside = {*system.signs} - {*signs}
        if any(not f.free_symbols.isdisjoint(beside) for f in forces.friction):
            return None  # on one side the friction may be zero, so that no sign keeps the surface
        moving, acts = {TIME, *system.states}, [(system.states[k], signs[i]) for i, k in own.items()]
        pairs = [(rate, x, sign) for x, sign in acts for rate in system.field if rate.has(sign)]
        if not all(common_to_all(*pair, moving) for pair in pairs) or not _definite(own_field, own, forces):
            return None
        made = _equations(own_field, system, slid, own, forces)
    except ModelError:  # raised below if the system is not of this kind
        return None
    return None if any(e.has(sp.zoo, sp.nan) for e in made.outputs) else made


def _ends_known(system: SwitchedField, index: int) -> bool:
    """Check whether a contact has no static friction, or static friction with two limits."""
    own = system.overrides.get(index)
    return own is None or (own.entry == "inside" and sorted(g.to_sign for g in system.hold_guards(index)) == [-1, 1])


def _own_states(system: SwitchedField) -> dict[int, int]:
    """Return, for each surface, a state that it determines from states that no earlier surface determines."""
    states, left = system.states, dict.fromkeys(range(len(system.surfaces)))
    found: dict[int, int] = {}
    while left:
        for k, x in enumerate(states):
            users = [i for i in left if x in system.surfaces[i].free_symbols]
            if len(users) == 1 and system.constant_slope(system.surfaces[users[0]], x) is not None:
                found[users[0]] = k
                del left[users[0]]
                break
        else:
            raise ModelError("contacts in a loop")
    return found


def _terms(expression: sp.Expr, signs: Collection[sp.Symbol]) -> Iterator[sp.Expr]:
    """Yield the terms of a sum, also of sums within products that contain signs."""
    if expression.is_Add:
        for term in expression.args:
            yield from _terms(term, signs)
        return
    inner = next((f for f in sp.Mul.make_args(expression) if f.is_Add and not f.free_symbols.isdisjoint(signs)), None)
    if inner is None:
        yield expression
        return
    others = sp.Mul(*(f for f in sp.Mul.make_args(expression) if f is not inner))
    for term in inner.args:
        yield from _terms(others * term, signs)


def _parts(system: SwitchedField, expression: sp.Expr) -> tuple[sp.Expr, dict[int, sp.Expr]]:
    """Return the part of a sum without signs and, by contact, the part with the contact's sign."""
    places = {sign: i for i, sign in enumerate(system.signs)}
    free, terms = list[sp.Expr](), dict[int, list[sp.Expr]]()
    for term in _terms(expression, set(places)):
        signs = [places[s] for s in term.free_symbols if s in places]
        if len(signs) > 1:
            raise ModelError("signs that multiply each other")
        (terms.setdefault(signs[0], []) if signs else free).append(term)
    return sp.Add(*free), {i: sp.Add(*own) for i, own in terms.items()}


def _constant(system: SwitchedField, expression: sp.Expr) -> sp.Expr:
    if expression.free_symbols & {TIME, *system.states, *system.signs}:
        raise ModelError("a factor that changes")
    return expression


def _forces(system: SwitchedField) -> Forces:
    count = len(system.surfaces)
    friction: dict[int, sp.Expr] = {}
    free, shares = list[sp.Expr](), list[Row]()
    for rate in system.field:
        rest, terms = _parts(system, rate)
        free.append(rest)
        units = {i: friction.setdefault(i, term) for i, term in terms.items()}
        shares.append({i: _constant(system, cancelled(term / units[i])) for i, term in terms.items()})
    if len(friction) < count or any(put(friction[i], {system.signs[i]: sp.S.Zero}) != 0 for i in friction):
        raise ModelError("a contact without friction in sliding")
    slopes: list[Row] = []
    for h in system.surfaces:
        row: Row = {}
        for k, x in enumerate(system.states):
            slope = _constant(system, sp.diff(h, x)) if h.has(x) else sp.S.Zero
            for i, share in shares[k].items() if slope != 0 else ():
                row[i] = row.get(i, sp.S.Zero) + slope * share
        slopes.append({i: value for i, value in row.items() if value != 0})
    return Forces(tuple(free), tuple(friction[i] for i in range(count)), tuple(shares), tuple(slopes))


def _definite(system: SwitchedField, own: Mapping[int, int], forces: Forces) -> bool:
    """Check that W is symmetric and definite up to column factors, and that frictions act against their velocities."""
    count = len(forces.slopes)
    entries = [forces.slopes[i].get(j, sp.S.Zero) for i in range(count) for j in range(count)]
    ways = [put(put(forces.friction[i], {system.signs[i]: sp.S.One}), _there(system, i, own[i])) for i in range(count)]
    found = system.sample((*entries, *ways))
    if not all(value.is_real for value in found):  # a root in a branch that is not used at the sample point
        return False
    values = np.array([float(v) for v in found])
    matrix, friction = values[: count * count].reshape(count, count), values[count * count :]
    scale = np.zeros(count)
    for first in range(count):
        if not scale[first]:  # a new connected part
            scale[first], waiting = np.sign(matrix[first, first]), [first]
            while waiting:
                i = waiting.pop()
                for j in np.flatnonzero(matrix[i]).tolist():
                    if not matrix[j, i]:
                        return False
                    if not scale[j]:
                        scale[j] = scale[i] * matrix[j, i] / matrix[i, j]
                        waiting.append(j)
    whole = matrix * scale
    eigenvalues = np.linalg.eigvalsh(whole)
    symmetric = np.allclose(whole, whole.T, rtol=1e-12, atol=0)
    return bool(symmetric and eigenvalues[0] > 1e-9 * eigenvalues[-1] and np.all(np.diag(matrix) * friction <= 0))


def _there(system: SwitchedField, index: int, state: int) -> dict[sp.Symbol, sp.Expr]:
    h, x = system.surfaces[index], system.states[state]
    return {x: sp.expand(x - h / system.constant_slope(h, x))}


Definitions = dict[sp.Symbol, sp.Expr]
"""Name -> its expression in earlier names, time and states."""


def _named(known: Definitions, name: str, expression: sp.Expr) -> sp.Expr:
    """Return a name defined as the expression, or the expression itself if it is a number or symbol."""
    if expression.is_Atom:
        return expression
    symbol = sp.Symbol(name, real=True)
    known[symbol] = expression
    return symbol


def _eliminated(matrix: list[Row], right: list[sp.Expr]) -> tuple[Definitions, list[sp.Symbol]]:
    """Return the solution of a linear system for the forces: definitions, and the names of the forces.

    The next pivot row is the one with the fewest columns of remaining rows.
    """
    known: Definitions = {}
    order: list[int] = []
    left = set(range(len(matrix)))
    inverse: dict[int, sp.Expr] = {}
    while left:
        i = min(left, key=lambda i: (sum(j in left for j in matrix[i]), i))
        left.remove(i)
        order.append(i)
        inverse[i] = _named(known, f"inverse_{i}", 1 / _named(known, f"pivot_{i}", matrix[i][i]))
        right[i] = _named(known, f"right_{i}", right[i])
        for r in sorted(left):
            if i in matrix[r]:
                factor = _named(known, f"factor_{r}_{i}", matrix[r].pop(i) * inverse[i])
                right[r] -= factor * right[i]
                for j in left:
                    if j in matrix[i]:
                        matrix[r][j] = matrix[r].get(j, sp.S.Zero) - factor * matrix[i][j]
    forces = [sp.Symbol(f"force_{i}", real=True) for i in range(len(matrix))]
    for i in reversed(order):
        later = order[order.index(i) + 1 :]
        rest = sp.Add(right[i], *(-matrix[i][j] * forces[j] for j in later if j in matrix[i]))
        known[forces[i]] = inverse[i] * rest
    return known, forces


def _equations(
    system: SwitchedField, held: SwitchedField, slid: Sequence[int], own: Mapping[int, int], acting: Forces
) -> SwitchedEquations:
    """Return the equations; ``system`` has only the surfaces with sliding: ``slid``, as indices of ``held``."""
    entries = entries_of(held.signs)
    switches = [tuple(entries[i][0])[1:] for i in slid]
    matrix, right = list[Row](), list[sp.Expr]()
    for i, (slip, slide) in enumerate(switches):
        row = {j: slide * slope for j, slope in acting.slopes[i].items()}
        matrix.append({**row, i: slip + row.get(i, sp.S.Zero)})
        free = along(system.surfaces[i], system.states, acting.free)
        right.append(slip * acting.friction[i] - slide * free)
    known, forces = _eliminated(matrix, right)
    rates = [
        sp.Add(free, *(share * forces[i] for i, share in row.items()))
        for free, row in zip(acting.free, acting.shares, strict=True)
    ]
    contacts: dict[int, Contact] = {}
    for i in reversed(own):  # the rates of earlier surfaces' states contain the states of later surfaces
        k = own[i]
        there = _there(system, i, k)
        kept = along(there[system.states[k]], system.states, tuple(rates))
        contacts[slid[i]] = Contact(k, rates[k], kept, _ends(system, held, slid[i], i, acting.friction, forces, there))
        slip, slide = switches[i]
        rates[k] = _named(known, f"rate_{k}", slip * rates[k] + slide * kept)
    made = tuple(contacts.get(i) for i in range(len(entries)))
    return SwitchedEquations(held, entries, made, tuple(rates), tuple(known.items()))


def _ends(
    system: SwitchedField,
    held: SwitchedField,
    surface: int,
    index: int,
    friction: Sequence[sp.Expr],
    names: Sequence[sp.Symbol],
    there: Mapping[sp.Symbol, sp.Expr],
) -> tuple[Guard, Guard]:
    """Return the guards that end the sliding on a ``surface`` of ``held``; ``index``: its index in ``system``."""
    guards = []
    if surface not in held.overrides:
        for side in (1, -1):
            limit = put(put(friction[index], {system.signs[index]: sp.Integer(side)}), there)
            guards.append(Guard("release", surface, side, 1 - names[index] / limit))
        return guards[0], guards[1]
    for guard in held.hold_guards(surface):
        rest, terms = _parts(system, guard.expression)
        if index in terms:
            raise ModelError("a load that depends on its own contact's sign")
        expression = put(rest, there)
        for j, term in terms.items():
            share = cancelled(put(term, there) / put(friction[j], there))
            expression += _constant(system, share) * names[j]
        guards.append(replace(guard, expression=expression))
    return guards[0], guards[1]
