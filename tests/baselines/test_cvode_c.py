"""CVODE from C: results within its tolerances, one compilation per system, and the reason if it is unavailable."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from shipped import proven

import henon_ref
from henon_ref.baselines import cvode_c as build
from henon_ref.baselines.cvode_c import ADAMS, BDF, c_equations
from henon_ref.baselines.protocol.problem_text import problem_text
from henon_ref.baselines.protocol.program import ProgramRun
from henon_ref.errors import UnavailableError
from henon_ref.harness import registry
from henon_ref.harness.campaign.journal import code_files
from henon_ref.harness.cli.lists import unavailable
from henon_ref.harness.registry import all_versions
from henon_ref.harness.score.scoring import score

installed = pytest.mark.skipif(
    not (build.compiler() and build.library_version().startswith("6.")), reason="no C compiler, or no SUNDIALS 6"
)
BLOCK = """
schema: 1
name: block
title: A block that friction of 1/4 brings to rest
system:
  state: [x, v]
  parameters: {F: 1/4}
  surfaces: {s: v}
  field: [v, "-x - F*s"]
initial: {t: 0, x: 1, v: 0}
until: 10
readings:
  first: {}
  weaker: {system: {parameters: {F: 1/5}}}
"""


@installed
@pytest.mark.parametrize("solver", [ADAMS, BDF], ids=lambda solver: solver.name)
@pytest.mark.parametrize(
    ("name", "reading", "error"),
    [
        *(("free_coulomb", "default", 1e-10), ("stribeck_belt", "default", 1e-8), ("fig8", "equations", 1e-9)),
        *(("fig8", "listing_limit", 1e-9), ("static_belt", "default", 1e-8), ("leaving_slide", "default", 1e-9)),
    ],
)
def test_every_transition_is_right_at_the_tightest_setting(solver, name, reading, error) -> None:
    case = henon_ref.load_case(name)
    own = case.reading(reading)
    found = solver.prepare(own.problem, rtol=1e-13, atol=1e-13)()
    scored = score(found, proven(case, own), tolerance=1e-13)
    assert (found.status, scored.status) == ("ok", "ok")
    assert scored.max_time_error is not None
    assert scored.max_time_error < error


@installed
@pytest.mark.parametrize("solver", [ADAMS, BDF], ids=lambda solver: solver.name)
def test_a_closed_form(solver) -> None:
    problem = henon_ref.parse_case(BLOCK).readings[0].problem
    found = solver.prepare(problem, rtol=1e-12, atol=1e-12)()
    assert [event.kind for event in found.transitions] == ["crossing", "stick"]
    assert [event.time for event in found.transitions] == pytest.approx([math.pi, 2 * math.pi], abs=1e-9)
    assert found.end_state == pytest.approx((0.0, 0.0), abs=1e-9)
    assert found.counts.steps > 10
    assert found.counts.rhs_evaluations > found.counts.steps
    assert found.max_surface_drift < 1e-12


@installed
@pytest.mark.parametrize("solver", [ADAMS, BDF], ids=lambda solver: solver.name)
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
def test_a_run_ends_where_its_field_does(solver, tolerance) -> None:
    """h' = -1/4 - sqrt(h) has no value behind h = 0, where its derivative is infinite: t = 2 - log(5)/2."""
    own = henon_ref.load_case("hard/running_dry").reading("pumped")
    found = solver.prepare(own.problem, rtol=tolerance, atol=tolerance)()
    assert found.status == "failed"
    assert found.end_time == pytest.approx(2 - math.log(5) / 2, abs=1e4 * tolerance)


@installed
def test_readings_that_differ_in_parameters_share_one_program_that_is_kept(monkeypatch) -> None:
    made = []
    compile_ = build.compile_program
    monkeypatch.setattr(build, "compile_program", lambda *arguments: (made.append(arguments[-1]), compile_(*arguments)))
    text = BLOCK.replace("block", f"block{id(made)}")
    first, weaker = (reading.problem for reading in henon_ref.parse_case(text).readings)
    equations = [c_equations(problem_text(problem, (-1,))) for problem in (first, weaker)]
    assert equations[0] == equations[1]
    programs = {build.program_for(own + f"/* {id(made)} */") for own in equations}
    assert len(programs) == 1
    assert len(made) == 1
    runs = [ADAMS.prepare(problem, rtol=1e-9) for problem in (first, weaker)]
    ends = [run().end_state[0] for run in runs]
    assert ends == pytest.approx([0.0, 0.2], abs=1e-6)


@installed
def test_its_own_clock_times_it() -> None:
    run = ADAMS.prepare(henon_ref.parse_case(BLOCK).readings[0].problem, rtol=1e-9)
    assert isinstance(run, ProgramRun)
    assert len(times := run.times(7)) == 7
    assert all(0 < time < 60 for time in times)


@installed
def test_a_run_past_its_time_says_so_with_what_it_has() -> None:
    own = henon_ref.load_case("fig8").reading("listing_limit")
    found = BDF.prepare(own.problem, rtol=1e-13, atol=1e-13, deadline=1e-3)()
    assert (found.status, found.reason) == ("timeout", "the time that a run may take has passed")
    assert found.end_time < float(own.problem.until)


@installed
def test_versions_are_in_the_manifest_and_in_the_list() -> None:
    version = build.library_version()
    assert all_versions()["sundials"] == version
    assert registry.library_version("cvode-c-adams") == ADAMS.version == version
    assert (registry.distribution("cvode-c-bdf"), unavailable("cvode-c-bdf")) == ("sundials", "")


def test_without_a_compiler_it_is_unavailable(monkeypatch) -> None:
    monkeypatch.setenv(build.VARIABLE, "/no/such/compiler")
    with pytest.raises(UnavailableError, match="there is no C compiler"):
        ADAMS.check()


@pytest.mark.skipif(not build.compiler(), reason="there is no C compiler")
def test_without_headers_or_with_others_it_is_unavailable(monkeypatch, tmp_path) -> None:
    monkeypatch.setenv(build.PREFIX, str(tmp_path))
    with pytest.raises(UnavailableError, match="headers are not installed"):
        ADAMS.check()
    (tmp_path / "include/sundials").mkdir(parents=True)
    (tmp_path / "include/sundials/sundials_config.h").write_text('#define SUNDIALS_VERSION "5.8.0"\n')
    with pytest.raises(UnavailableError, match=r"version 5.8.0, wanted 6.x"):
        ADAMS.check()
    (tmp_path / "include/sundials/sundials_config.h").write_text('#define SUNDIALS_VERSION "6.0.0"\n')
    with pytest.raises(UnavailableError, match="does not compile the program: "):
        ADAMS.prepare(henon_ref.parse_case(BLOCK).readings[0].problem, rtol=1e-9)
    problem = henon_ref.parse_case(BLOCK)
    row = henon_ref.compare(problem, solvers=["cvode-c-adams"], tolerances=[1e-6], repeats=1).runs.iloc[0]
    assert row["status"] == "unavailable"


def test_the_version_of_the_code_is_that_of_its_programs_too() -> None:
    names = {path.rsplit("/", 1)[-1] for path in code_files(str(Path(build.__file__).parents[1]))}
    assert {"cvode.c", "json.h", "response.h", "ode45.m", "relay.py"} <= names
