"""What a case file cannot say, each with its place in the file."""

from __future__ import annotations

import pytest
from random_scenes import deadline
from slide import SLIDE, changed, refusal

from henon_ref.casefile.case import parse_case


def chain(first: str, step: str) -> str:
    """The case with 200 parameters, a line each, every one made of the one before it."""
    lines = [f"    p{i}: {step.format(p=f'p{i - 1}')}\n" for i in range(1, 201)]
    return changed("{F: 1}", f"\n    F: 1\n    p0: {first}\n{''.join(lines)}")


@pytest.mark.parametrize(
    ("text", "index"),
    [
        (chain("1", "sin({p})"), 17),
        (chain("sqrt(2)", "1/(1 + {p})"), 8),
        (chain("sqrt(2)", "sqrt(3)*(1 + {p})"), 8),
        (chain("1", "exp(-{p})"), 9),
    ],
)
def test_numbers_do_not_nest_without_end_through_parameters(text: str, index: int) -> None:
    with deadline(60):  # written out they would take for ever
        error = refusal(text)
    assert error.line == 9 + index
    assert (
        f"in 'p{index}': operations nest deeper than 16 in this number, with all parameters in it written out"
        in str(error)
    )


def test_rational_parameters_may_use_each_other_in_a_long_chain() -> None:
    assert len(parse_case(chain("1", "{p} + 1")).readings[0].problem.system.parameters) == 202


@pytest.mark.parametrize(
    ("text", "place", "says"),
    [
        (changed("until: 3", "untill: 3"), "12:1", "unknown key 'untill'; did you mean 'until'"),
        (changed("until: 3", "until: 3\npoints: {}"), "13:1", "(a sweep file is run by henon-ref sweep)"),
        (changed("  state: [x]", "  states: [x]"), "6:3", "unknown key 'states' in 'system'; did you mean 'state'"),
        (changed("until: 3\n", ""), "1:1", "the key 'until' is missing"),
        (changed("schema: 1\n", ""), "1:1", "'schema' is missing"),
        (changed("schema: 1", "schema: 2"), "1:9", "must be 1"),
        (changed("schema: 1", "schema: true"), "1:9", "must be 1"),
        (changed("schema: 1", "schema: 1.0"), "1:9", "must be 1"),
        (changed("name: leaving_slide", "name: ../slide"), "2:7", "a-z, 0-9 and _"),
        (changed("leaving_slide", "a" * 65), "2:7", "at most 64 characters, not 65"),
        (changed("Leaving a slide", '"Leaving\\ea slide"'), "3:8", "control character U+001B"),
        (changed("where it comes from", '"here\\u2028there"'), "4:9", "control character U+2028"),
        (SLIDE + 'story: "half of a pair: \\ud800"\n', "19:8", "control character U+D800"),
        (SLIDE + 'tags: [a, "b\\0"]\n', "19:11", "control character U+0000"),
        (changed("title: Leaving a slide", "title: 5"), "3:8", "must be text"),
        (changed("t - F*s", "t - G*s"), "9:16", "unknown name 'G'"),
        (changed('["t - F*s"]', "[t - F*s, x]"), "9:10", "one for each state"),
        (changed("t - F*s", "__import__('os')"), "9:12", "unknown name '__import__'"),
        (changed("t - F*s", "t - s*floor(x)"), "9:18", "jumps infinitely often"),
        (changed("t - F*s", "t - s*abs(F)"), "9:11", "sign(p) is p/abs(p)"),
        (changed("t - F*s", "t - s/(1 + sign(x - 1))"), "9:11", "division by zero (where x - 1 has the sign -1)"),
        (changed("{F: 1}", "{kink1: 1}").replace("F*s", "kink1*abs(x - 1)"), "9:3", "rename the 'kink1'"),
        (changed("t - F*s", "t - s/(F - 1)"), "9:17", "division by zero (with the values"),
        (changed("t - F*s", "t/(1 + s)"), "9:13", "division by zero (at s = -1)"),
        (changed('["t - F*s"]', "\n    - >-\n      t -\n      G*s"), "10:7", "unknown name 'G'"),
        (changed("{F: 1}", "{F: 9**9**9**9}"), "7:23", "too large"),
        (changed("{F: 1}", "{F: .nan}"), "7:19", "finite"),
        (changed("{F: 1}", "{F: -.inf}"), "7:19", "finite"),
        (changed("{F: 1}", "{F: 1e309}"), "7:19", "largest double"),
        (changed("{F: 1}", "{F: }"), "7:16", "number or an expression"),
        (changed("{F: 1}", "{F: true}"), "7:19", "number or an expression"),
        (changed("{F: 1}", "{F: 2001-01-01}"), "7:19", "2001-01-01 is a date"),
        (changed("until: 3", "until: 2001-01-01"), "12:8", "2001-01-01 is a date"),
        (changed('{s: "x"}', "{}").replace("F*s", "F"), "5:1", "add a surface"),
        (changed("[x]", f"[{', '.join(f'x{i}' for i in range(257))}]"), "6:10", "at most 256 entries"),
        (
            changed('{s: "x"}', f"{{{', '.join(f's{i}: x' for i in range(257))}}}"),
            "8:13",
            "at most 256 entries",
        ),
        (changed("{after: 0}", "{after: 30}"), "13:18", "earlier than 'until', 3"),
        (changed("{after: 0}", "{after: 3*F}"), "13:18", "earlier than 'until', 3"),
        (changed("[1.00]", "[-1]"), "14:31", "larger than 0"),
        (changed("[1.00]", "[1, 0]"), "14:34", "larger than 0"),
        (SLIDE + "steps: [1e-400]\n", "19:9", "larger than 0"),
        (SLIDE + "orbit: {period: 1, sticks: [-0.5]}\n", "19:29", "larger than 0"),
        (SLIDE + "sliding: {s: {field: [0], release: [{when: x, direction: rising, to: true}]}}", "19:70", "-1 or 1"),
        (changed("{F: 1}", "{F: 2*G, G: H, H: F}"), "7:19", "in a cycle: F -> G -> H -> F"),
        (changed("{F: 1}", "{F: 1, pi: 3}"), "7:22", "'pi' is reserved"),
        (changed("{F: 1}", "{F: 1, lambda: 3}"), "7:22", "'lambda'"),
        (changed("{F: 1}", "{F: 1, x: 3}"), "6:11", "already the name of a parameter"),
        (changed("[x]", "[x, time_s]"), "6:14", "'time_s' is the name of another column of transitions.csv"),
        (changed("[x]", "[x, outcome]"), "6:14", "'outcome' is the name of another column of transitions.csv"),
        (changed('{s: "x"}', "{s: F}"), "8:17", "is constant"),
        (changed('{s: "x"}', "{s: x + s}"), "8:21", "unknown name 's'"),
        (changed("{t: 0, x: 0}", "{t: 0}"), "11:1", "lacks the state x"),
        (changed("{t: 0, x: 0}", "{t: 0, x: 0, y: 1}"), "11:23", "'y' is not a state"),
        (changed("{t: 0, x: 0}", "{t: 0, x: 0, mode: {s: 2}}"), "11:33", "-1 or 1"),
        (changed("{t: 0, x: 0}", "{t: 0, x: 0, mode: {q: 1}}"), "11:30", "'q' is not a surface"),
        (changed("{t: 0, x: 0}", "{t: 0, x: 1/3, mode: {s: 0}}"), "11:35", "not on the surface"),
        (changed('["t - F*s"]', "[t]").replace("x: 0}", "x: 0, mode: {s: 0}}"), "11:29", "cannot slide together"),
        (changed("until: 3", "until: 0"), "12:8", "later than the start"),
        (changed("until: 3", "until: 1e-400"), "12:8", "later than the start"),
        (changed("until: 3", "until: soon"), "12:8", "unknown name 'soon'"),
        (changed("[1.00]", "[one]"), "14:31", "not the text 'one'"),
        (changed('["1"]', '["2", "1"]'), "15:33", "in increasing order"),
        (changed('["1"]', '["7/2"]'), "15:28", "after 'until'"),
        (changed("[1e-6, 1e-9", "[1e-6, 1e-19"), "17:20", "between 1e-16 and 1"),
        (changed("[1e-6, 1e-9", "[1e-6, 1e-400"), "17:20", "a tolerance lies between 1e-16 and 1, not 1e-400"),
        (changed("[1e-6, 1e-9", "[1e-6, '1e-9'"), "17:20", "not the text"),
        (changed("[1e-6, 1e-9", "[1e-6, 1e-6"), "17:20", "is listed twice"),
        (changed("gate: {henon", "gate: {cvode-bdf"), "18:8", "not among 'solvers'"),
        (SLIDE + "expect: {time: 99}\n", "19:16", "ends at 'until', 3; leave 'time' out"),
        (SLIDE + "expect: {status: ok, time: 1}\n", "19:28", "ends at 'until', 3; leave 'time' out"),
        (SLIDE + "expect: {status: failed, time: 99}\n", "19:32", "between the start, 0, and 'until', 3"),
        (SLIDE + "expect: {status: failed, time: -F}\n", "19:32", "between the start, 0, and 'until', 3"),
        (changed("{max_time_error: 1e-11}", "{at: 1e-7, max_time_error: 1}"), "18:20", "not among 'tolerances'"),
        (changed("{max_time_error: 1e-11}", "{max_error: 1e-11}"), "18:16", "did you mean 'max_time_error'"),
        (SLIDE + "until: 4\n", "19:1", "twice"),
        (SLIDE + "scene: {bodies: {a: {mass: 1}}, connections: []}\n", "19:1", "either 'system' or 'scene'"),
        ("scene: {bodies: {a: {mass: 1}}, connections: []}\n" + SLIDE, "6:1", "either 'system' or 'scene'"),
        (SLIDE[: SLIDE.index("system:")] + SLIDE[SLIDE.index("initial:") :], "1:1", "either 'system' or 'scene'"),
        (SLIDE + "sliding: {q: {field: [0], release: [{when: x, direction: rising, to: 1}]}}", "19:11", "is not a"),
        (SLIDE + "sliding: {s: {field: [0], release: [{when: x, direction: up, to: 1}]}}", "19:58", "'rising'"),
        (SLIDE + "sliding: {s: {field: [0, 0], release: [{when: x, direction: rising, to: 1}]}}", "19:22", "one for"),
        (SLIDE + "expect: {status: fine, reason: why}\n", "19:18", "'nonunique'"),
    ],
)
def test_what_cannot_be_used_is_refused_with_its_place(text: str, place: str, says: str) -> None:
    error = refusal(text)
    assert says in error.message
    assert str(error).startswith(f"case.yaml:{place}: ")


def test_a_fixed_step_solver_has_no_row_at_a_tolerance() -> None:
    text = changed("{max_time_error: 1e-11}", "{max_time_error: 1e-11, at: 1e-6}")
    error = refusal(text, fixed_step=lambda name: name == "henon")
    assert str(error).startswith("case.yaml:18:39: 'henon' has steps, not tolerances")
    assert parse_case(text, fixed_step=lambda name: False).readings[0].gate["henon"].at == 1e-6


def test_solvers_that_do_not_exist_are_refused_where_the_caller_knows_them() -> None:
    error = refusal(changed("[henon, heyoka]", "[henon, hejoka]"), solvers=["henon", "heyoka"])
    assert "did you mean 'heyoka'" in error.message
    assert (error.line, error.column) == (16, 18)


@pytest.mark.parametrize(
    ("readings", "place", "says"),
    [
        ("readings: [a]", "19:11", "must be a mapping"),
        ("readings: {}", "19:11", "with at least one reading"),
        ("readings:\n  A: {}", "20:3", "a-z, 0-9 and _"),
        (f"readings:\n  {'a' * 65}: {{}}", "20:3", "at most 64 characters, not 65"),
        ("readings:\n  a: {measure: {after: 2}, until: 2}", "20:24", "earlier than 'until', 2 [reading 'a']"),
        ("readings:\n  a: {scene: {bodies: {a: {mass: 1}}, connections: []}}", "20:7", "either 'system' or 'scene'"),
        ("readings:\n  a: 1", "20:6", "must be a mapping"),
        ("readings:\n  a: {name: b}", "20:7", "cannot change the key 'name'"),
        ("readings:\n  a: {}\n  b: {until: -1}", "21:14", "[reading 'b']"),
        ("readings:\n  a: {system: {field: [1, 2]}}", "20:23", "one for each state"),
        ("readings:\n  a:\n    initial: null", "21:5", "'initial' is missing [reading 'a']"),
    ],
)
def test_an_error_in_a_reading_points_into_the_reading(readings: str, place: str, says: str) -> None:
    error = refusal(f"{SLIDE}{readings}\n")
    assert says in str(error)
    assert str(error).startswith(f"case.yaml:{place}: ")


def test_a_parameter_that_a_reading_adds_must_have_a_use() -> None:
    """A misspelt name would otherwise leave the parameter of the case as it is."""
    one = "readings:\n  a: {system: {parameters: {f: 2}}}\n"
    error = refusal(SLIDE + one)
    assert error.message == "no expression uses the parameter 'f'; did you mean 'F'?; parameters: F [reading 'a']"
    assert (error.line, error.column) == (20, 29)
    bare = changed("parameters: {F: 1}", "parameters: {}").replace("F*s", "s") + one
    assert "'f'; parameters: none [reading 'a']" in refusal(bare).message
    used = "readings:\n  a: {system: {parameters: {f: 2, F: f}}}\n  b: {system: {parameters: {g: 2}}, until: g + 1}\n"
    used += "  c: {system: {parameters: {g: 5}}}\n"  # another reading uses it
    assert [float(reading.problem.until) for reading in parse_case(SLIDE + used).readings] == [3, 3, 3]


def test_the_texts_at_the_top_are_checked_where_every_reading_has_its_own() -> None:
    readings = "readings:\n  a: {title: its own, source: its own}\n"
    error = refusal(changed("Leaving a slide", "5") + readings)
    assert "'title': must be text" in error.message
    assert (error.line, error.column) == (3, 8)
    error = refusal(changed("where it comes from", '"\\e"') + readings)
    assert "'source': the control character U+001B" in error.message
    assert (error.line, error.column) == (4, 9)
    assert parse_case(changed("where it comes from", "~") + readings).source is None


def test_a_scene_without_friction_is_no_case() -> None:
    model = SLIDE[SLIDE.index("system:") : SLIDE.index("initial:")]
    scene = "scene: {bodies: {a: {mass: 1}}, connections: [force: {on: a, value: 1}]}\n"
    error = refusal(SLIDE.replace(model, scene).replace("x: 0}", "x_a: 1, v_a: 0}"))
    assert "add a friction or a stop" in error.message
    assert (error.line, error.column) == (5, 33)


def test_parameters_that_double_in_size_are_stopped() -> None:
    grown = "".join(f"    p{i}: sqrt(p{i - 1} + 1) + cos(p{i - 1})\n" for i in range(1, 60))
    text = changed("  parameters: {F: 1}\n", f"  parameters:\n    F: 1\n    p0: sqrt(2)\n{grown}")
    assert "numbers and operations" in refusal(text).message
