"""The page on the protocol: its example equals an actual exchange, and it explains every field."""

from __future__ import annotations

import json
import math
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from pydantic import BaseModel
from shipped import proven

import henon_ref
from henon_ref.baselines.protocol import messages
from henon_ref.baselines.protocol.program import ProgramRun, ProgramSolver, read_response
from henon_ref.harness.score.scoring import score

DOCS = Path(__file__).parents[3] / "docs"
PAGE = (DOCS / "protocol.md").read_text(encoding="utf-8")
CASE, REQUEST, RESPONSE = (
    re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)[number]
    for language, number in (("yaml", 0), ("json", 0), ("json", 1))
)
PERL = shutil.which("perl") or ""
MINIMAL = ProgramSolver("minimal", ("perl", str(DOCS / "protocol/minimal.pl")), landing="bisection")


def has_perl() -> bool:
    return (
        bool(PERL) and subprocess.run([PERL, "-MJSON::PP", "-e", "1"], capture_output=True, check=False).returncode == 0
    )


needs_perl = pytest.mark.skipif(not has_perl(), reason="there is no Perl with JSON::PP")


def example() -> ProgramRun:
    problem = henon_ref.parse_case(CASE).readings[0].problem
    run = MINIMAL.prepare(problem, rtol=1e-9, atol=1e-9, deadline=10.0)
    assert isinstance(run, ProgramRun)
    return run


def test_the_example_is_what_is_sent() -> None:
    assert json.loads(REQUEST) == json.loads(example().request.model_dump_json())


def test_the_example_s_response_is_one() -> None:
    found = read_response(RESPONSE.encode(), example().request)
    times = [event.time for event in found.transitions]
    assert times == pytest.approx([2 - math.sqrt(2), math.sqrt(2), 2], abs=1e-12)


@pytest.mark.parametrize(
    "message",
    [getattr(messages, name) for name in ("Request", "Problem", "Mode", "Guard", "Successor", "Response", "Work")],
)
def test_every_field_is_on_the_page(message: type[BaseModel]) -> None:
    for name in message.model_fields:
        assert f"`{name}`" in PAGE or f"`{name}." in PAGE, name


@needs_perl
def test_the_minimal_program_writes_the_example_s_response() -> None:
    found = example()()
    expected = json.loads(RESPONSE)
    assert found.status == "ok"
    assert [event.time for event in found.transitions] == pytest.approx(
        [event["time"] for event in expected["transitions"]], abs=1e-12
    )
    assert found.end_state == pytest.approx(expected["end"]["state"], abs=1e-12)
    assert found.counts.steps == expected["work"]["steps"]


@needs_perl
@pytest.mark.parametrize("name", ["free_coulomb", "stribeck_belt"])
def test_the_minimal_program_is_right(name: str) -> None:
    case = henon_ref.load_case(name)
    found = MINIMAL.prepare(case.readings[0].problem, rtol=1e-9, atol=1e-9)()
    assert score(found, proven(case, case.readings[0]), tolerance=1e-6).status == "ok"
