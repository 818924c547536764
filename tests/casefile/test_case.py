"""Case files: what is read, what is refused and where, readings, and the hash of the mathematics."""

from __future__ import annotations

import pickle
import re
from decimal import Decimal
from pathlib import Path

import pytest
import sympy as sp
from slide import SLIDE, changed

from henon_ref.casefile.case import Case, load_case, parse_case
from henon_ref.errors import CaseError
from henon_ref.expressions.grammar import TAKEN
from henon_ref.harness.rows import TransitionRow
from henon_ref.modes.switched_field import Release


def test_a_case_from_text_needs_text() -> None:
    with pytest.raises(CaseError, match="text is 3, wanted a str"):
        parse_case(3)  # type: ignore[arg-type]


def test_the_case_file_of_the_contract_is_read() -> None:
    case = parse_case(SLIDE)
    (reading,) = case.readings
    system = reading.problem.system
    t, x, s, F = (sp.Symbol(name, real=True) for name in ("t", "x", "s", "F"))
    assert (case.name, case.title, case.source) == ("leaving_slide", "Leaving a slide", "where it comes from")
    assert reading.name == "default"
    assert (system.states, system.signs, system.surfaces) == ((x,), (s,), (x,))
    assert system.field == (t - F * s,)
    assert system.parameters == {F: 1}
    assert system.valid == (10 - x,)
    assert (reading.problem.start, reading.problem.initial, reading.problem.until) == (0, (0,), 3)
    assert reading.problem.initial_mode == {}
    assert reading.solvers == ("henon", "heyoka")
    assert reading.tolerances == (1e-6, 1e-9, 1e-12)
    assert reading.measure_after == 0
    assert reading.exact is not None
    assert reading.exact.transition_times == (1,)
    assert reading.published is not None
    assert str(reading.published.stick_durations[0]) == "1.00"
    assert reading.gate["henon"].max_time_error == 1e-11


def test_a_case_can_be_sent_to_a_process() -> None:
    case = parse_case(SLIDE.replace("gate: {henon: {max_time_error: 1e-11}}\n", ""))
    assert case.readings[0].gate == {}
    assert pickle.loads(pickle.dumps(case)).readings[0].mathematics_hash == case.readings[0].mathematics_hash


def test_numbers_are_exact_and_parameters_use_each_other_in_any_order() -> None:
    text = changed("{F: 1}", "{F: 2*G/3, G: 0.3, H: sqrt(G)}").replace("x: 0}", "x: -H, mode: {s: -1}}")
    problem = parse_case(text).readings[0].problem
    values = {symbol.name: value for symbol, value in problem.system.parameters.items()}
    assert values == {"F": sp.Rational(1, 5), "G": sp.Rational(3, 10), "H": sp.sqrt(sp.Rational(3, 10))}
    assert problem.initial == (-values["H"],)
    assert problem.initial_mode == {0: -1}


def test_a_reading_lays_its_keys_over_those_at_the_top() -> None:
    case = parse_case(
        SLIDE
        + """\
readings:
  plain: {}
  harder:
    title: With more friction
    system: {parameters: {F: 2}}
    exact: null
    tolerances: [1e-3]
"""
    )
    plain, harder = case.readings
    assert [reading.name for reading in case.readings] == ["plain", "harder"]
    assert case.reading("harder") is harder
    assert (plain.title, harder.title) == ("Leaving a slide", "With more friction")
    assert (plain.tolerances, harder.tolerances) == ((1e-6, 1e-9, 1e-12), (1e-3,))
    assert (plain.exact is None, harder.exact is None) == (False, True)
    assert list(harder.problem.system.parameters.values()) == [2]
    assert harder.problem.system.field == plain.problem.system.field
    assert plain.mathematics_hash != harder.mathematics_hash
    with pytest.raises(CaseError, match="did you mean 'harder'"):
        case.reading("Harder")


def test_sliding_in_a_sources_own_way_replaces_filippovs() -> None:
    text = SLIDE + "sliding: {s: {field: [0], release: [{when: t - F, direction: rising, to: 1}]}}\n"
    system = parse_case(text).readings[0].problem.system
    t, F = (sp.Symbol(name, real=True) for name in ("t", "F"))
    assert system.overrides[0].field == (0,)
    assert system.overrides[0].release == (Release(t - F, "rising", 1),)
    assert system.equations((0,)).field == (0,)


def test_the_hash_is_of_the_mathematics_alone() -> None:
    def key(text: str) -> str:
        return parse_case(text).readings[0].mathematics_hash

    same = key(SLIDE)
    for old, new in (
        ("title: Leaving a slide", "title: Another title  # and a comment"),
        ("tolerances: [1e-6, 1e-9, 1e-12]", "tolerances: [1e-3]"),
        ('["t - F*s"]', "\n    - t-F * s"),
        ("{F: 1}", "{F: 1.0, unused: 7}"),
        ("[henon, heyoka]", "[henon]"),
        ("until: 3", "until: 9/3"),
        ("exact: {transition_times: ['1']}".replace("'", '"'), "tags: [slide]"),
    ):
        assert key(changed(old, new)) == same, new
    for old, new in (
        ("{F: 1}", "{F: 2}"),
        ("t - F*s", "t + F*s"),
        ('{s: "x"}', "{s: 2*x}"),
        ('["10 - x"]', "[]"),
        ("x: 0}", "x: 1e-30}"),
        ("x: 0}", "x: 0, mode: {s: 0}}"),
        ("until: 3", "until: 4"),
    ):
        assert key(changed(old, new)) != same, new


def test_the_optional_answers_are_read() -> None:
    text = (
        SLIDE
        + "orbit: {period: 2*pi, sticks: [0.50], crossings: [1]}\nexpect: {status: diverged, reason: r, time: F}\n"
    )
    reading = parse_case(text).readings[0]
    assert reading.orbit is not None
    assert (reading.orbit.period, reading.orbit.sticks) == (2 * sp.pi, (Decimal("0.50"),))
    assert reading.expect is not None
    assert (reading.expect.status, reading.expect.time) == ("diverged", 1)
    assert reading.steps == (1e-3,)


@pytest.mark.parametrize(
    ("expect", "status", "reason", "verdict"),
    [
        ("{status: nonunique}", "nonunique", None, None),
        ("{verdict: ill-conditioned}", "ok", None, "ill-conditioned"),
        ("{status: failed, reason: why}", "failed", "why", None),
    ],
)
def test_an_expectation_needs_no_reason_and_is_of_an_end_at_the_horizon(
    expect: str, status: str, reason: str | None, verdict: str | None
) -> None:
    found = parse_case(f"{SLIDE}expect: {expect}\n").readings[0].expect
    assert found is not None
    assert (found.status, found.reason, found.verdict) == (status, reason, verdict)


def test_the_expectations_of_the_documentation_are_read() -> None:
    page = (Path(__file__).parents[2] / "docs" / "compare.md").read_text(encoding="utf-8")
    examples = re.findall(r"`(expect: \{.*?\})`", page)
    assert len(examples) == 2
    for example in examples:
        assert parse_case(f"{SLIDE}{example}\n").readings[0].expect is not None


def test_texts_that_reports_set_in_one_line_are_folded() -> None:
    text = changed("title: Leaving a slide", "title: |\n  Leaving\n    a slide\n")
    text = text.replace("source: where it", "source: >\n  where it\n\n ")
    case = parse_case(text + 'story: "two\\nlines"\ntags: ["a\\n\\tb"]\n')
    (reading,) = case.readings
    assert (case.title, case.source) == ("Leaving a slide", "where it comes from")
    assert (reading.title, reading.source, reading.tags) == ("Leaving a slide", "where it comes from", ("a b",))
    assert reading.story == "two\nlines"


def test_a_case_remembers_its_file(tmp_path: Path) -> None:
    path = tmp_path / "case.yaml"
    path.write_text(SLIDE)
    case = load_case(path)
    assert isinstance(case, Case)
    assert case.path == path
    path.write_text(changed("until: 3", "until: -3"))
    with pytest.raises(CaseError) as caught:
        load_case(path)
    assert str(caught.value).startswith(f"{path}:12:8: ")


@pytest.mark.parametrize("path", [None, b"case.yaml", 3])
def test_what_is_no_path_is_refused(path: object) -> None:
    with pytest.raises(CaseError, match="wanted a str or a Path"):
        load_case(path)  # type: ignore[arg-type]


def test_names_that_states_may_not_have_are_the_columns_of_the_transitions() -> None:
    assert TransitionRow.columns() == tuple(sorted(TAKEN, key=TransitionRow.columns().index))
