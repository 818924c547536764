"""The periodic motion of Fig. 8, which long runs and operations are measured on."""

from __future__ import annotations

from henon_ref.casefile.case import parse_case
from henon_ref.modes.problem import Problem

FIG8 = """\
schema: 1
name: fig8_orbit
title: The motion of Fig. 8's `listing_limit`
system:
  state: [x1, x2]
  parameters: {m: 0.1, vp: 0.4, mu0: sqrt(3)/9, A: 4*sqrt(3)/3*sin(pi/18), w: 3*pi/2/1.2364, zs: 2*sqrt(3)/3*sin(pi/18)}
  surfaces: {s: x2 - vp}
  field:
    - 3*x2
    - 3*(-(x1 - A*sin(w*t)) + (x1 - A*sin(w*t))^3 - s*mu0/(1 + s*(x2 - vp)))/m
sliding:
  s:
    field: [vp, 0]
    release: [{when: x1 - A*sin(w*t) - zs, direction: rising, to: -1}]
initial: {t: 0, x1: -zs, x2: vp, mode: {s: 0}}
until: 70
"""
"""Fig. 8's `listing_limit`, independent of the cases on the command line (a test compares it with the case file)."""


def orbit_problem() -> Problem:
    """The problem whose motion is periodic: Fig. 8's `listing_limit`."""
    return parse_case(FIG8).readings[0].problem
