"""``resets`` of a case file: what it says, and what is said of what it may not say."""

from __future__ import annotations

import pytest
import sympy as sp

from henon_ref.casefile.case import parse_case
from henon_ref.errors import CaseError
from henon_ref.modes.switched_field import Reset

TEXT = """schema: 1
name: ball
title: Bouncing ball
system:
  state: [x, v]
  parameters: {g: 10, r: 0.8}
  surfaces: {s: "x"}
  field: ["v", "-g"]
resets:
  s: {when: falling, map: {v: "-r*v"}}
initial: {x: 1, v: 0}
until: 3
"""


def test_a_reset_is_read_and_belongs_to_the_mathematics() -> None:
    reading = parse_case(TEXT).readings[0]
    system = reading.problem.system
    r, v = sp.symbols("r v", real=True)
    assert system.resets == {0: Reset({v: -r * v})}
    softer = parse_case(TEXT.replace("-r*v", "-r*v/2")).readings[0]
    without = parse_case(TEXT.replace('resets:\n  s: {when: falling, map: {v: "-r*v"}}\n', "")).readings[0]
    assert len({reading.mathematics_hash, softer.mathematics_hash, without.mathematics_hash}) == 3


@pytest.mark.parametrize(
    ("old", "new", "place", "message"),
    [
        ("  s: {when", "  z: {when", (10, 3), "'z' is not a surface; surfaces: s"),
        ('{v: "-r*v"}', '{w: "-r*v"}', (10, 28), "'w' is not a state; states: x, v"),
        ('{v: "-r*v"}', '{v: "-q*v"}', (10, 33), "in 'v': unknown name 'q'"),
        ('{v: "-r*v"}', '{v: "v"}', (10, 22), "the map changes no state; leave the reset out"),
        ('{v: "-r*v"}', "{}", (10, 27), "map"),
        ("falling", "rising", (10, 13), "falling"),
        ("until: 3", "until: 3\nsliding: {s: {field: [v, 0], release: [{when: v, direction: rising, to: 1}]}}",
         (10, 3), "'s' has a sliding mode under 'sliding'; a surface may have that or a reset, not both"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_refused_with_its_place(old: str, new: str, place: tuple[int, int], message: str) -> None:
    with pytest.raises(CaseError) as caught:
        parse_case(TEXT.replace(old, new))
    assert (caught.value.line, caught.value.column) == place
    assert message in caught.value.message
