"""The case file of the contract, with changes, and the error that a change causes."""

from __future__ import annotations

from typing import Any

import pytest

from henon_ref.casefile.case import parse_case
from henon_ref.errors import CaseError

SLIDE = """\
schema: 1
name: leaving_slide
title: Leaving a slide
source: where it comes from
system:
  state: [x]
  parameters: {F: 1}
  surfaces: {s: "x"}
  field: ["t - F*s"]
  valid: ["10 - x"]
initial: {t: 0, x: 0}
until: 3
measure: {after: 0}
published: {stick_durations: [1.00]}
exact: {transition_times: ["1"]}
solvers: [henon, heyoka]
tolerances: [1e-6, 1e-9, 1e-12]
gate: {henon: {max_time_error: 1e-11}}
"""


def changed(old: str, new: str) -> str:
    assert SLIDE.count(old) == 1
    return SLIDE.replace(old, new)


def refusal(text: str, **options: Any) -> CaseError:
    with pytest.raises(CaseError) as caught:
        parse_case(text, file="case.yaml", **options)
    assert "\n" not in str(caught.value)
    return caught.value
