"""Causes of failures: every claim holds for the library that is installed."""

from __future__ import annotations

import importlib.util
from dataclasses import replace

import pytest
from made_reports import study_request

from henon_ref.baselines.causes import CAUSES, Cause, ClaimError
from henon_ref.baselines.cvode_c import compiler
from henon_ref.harness.campaign.causes import PATTERNS
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.registry import program_versions
from henon_ref.harness.studies.page import run_causes

MODULES = {"heyoka": "heyoka"} | dict.fromkeys(("cvode", "ida", "sundials", "sundae"), "sksundae")
MODULES |= {"diffrax": "diffrax", "diffsol": "pydiffsol", "nosnoc": "nosnoc"}
"""First word of a cause's name -> what it is shown by, where that is not SciPy."""
SLOW = {name for name in CAUSES if name.startswith(("diffrax", "nosnoc"))} - {"diffrax-pair", "nosnoc-infeasible"}
"""Each compiles for half a minute, or solves hundreds of problems, in a process of its own; daily: one a library."""


@pytest.mark.parametrize(
    "cause",
    [pytest.param(cause, id=name, marks=[pytest.mark.slow] if name in SLOW else []) for name, cause in CAUSES.items()],
)
def test_the_library_alone_does_what_is_claimed(cause: Cause) -> None:
    if cause.package in (programs := program_versions()):
        if not programs[cause.package] or (cause.package == "sundials" and not compiler()):
            pytest.skip(f"{cause.package} is not installed")
    # Not imported here: processes that fork must not have jax's threads.
    elif importlib.util.find_spec(MODULES.get(cause.name.split("-")[0], "scipy")) is None:
        pytest.skip(f"{cause.package} is not installed")
    assert cause.check()


def test_every_pattern_names_a_cause() -> None:
    assert {pattern.cause for pattern in PATTERNS} <= set(CAUSES)


def test_the_page_says_so_where_a_claim_does_not_hold(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    def fails() -> str:
        raise ClaimError("it found both")

    broken = replace(CAUSES["scipy-pair"], check=fails)
    monkeypatch.setattr("henon_ref.baselines.causes.CAUSES", {"scipy-pair": broken})
    text = run_causes(study_request([], Options(), tmp_path)).page.read_text(encoding="utf-8")
    assert "**not as claimed with this version**: it found both." in text
    assert '<a id="scipy-pair"></a>' in text
