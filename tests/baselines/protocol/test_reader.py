"""The reader of responses: valid responses unchanged, and one error message for any other bytes."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import fastjsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from programs import FINE, request

from henon_ref.baselines.protocol.messages import Request, Response, schema_text
from henon_ref.baselines.protocol.program import read_response, trajectory
from henon_ref.errors import ContractError, UnavailableError, UnsupportedError
from henon_ref.trajectory import Counts

DOCS = Path(__file__).parents[3] / "docs" / "protocol"
REQUEST = request()


def changed(path: str, value: object) -> dict[str, Any]:
    """:data:`FINE` with one value replaced, by its place."""
    whole: Any = copy.deepcopy(FINE)
    *places, last = (int(part) if part.isdigit() else part for part in path.split("."))
    at = whole
    for place in places:
        at = at[place]
    at[last] = value
    return whole


def read(message: object) -> Response:
    return read_response(json.dumps(message).encode(), REQUEST)


def test_a_right_response_is_a_trajectory() -> None:
    message = FINE | {"work": {"steps": 3, "fields": 20, "guards": 4}, "max_surface_drift": 0.25, "reason": ""}
    found = trajectory(read(message), REQUEST, "bisection")
    assert (found.status, found.end_time, found.end_state, found.end_mode) == ("ok", 2.0, (1.0,), (1,))
    assert (found.counts, found.max_surface_drift) == (Counts(3, 20, 4), 0.25)
    (event,) = found.transitions
    assert (event.kind, event.surface, event.from_mode, event.to_mode) == ("crossing", 0, (-1,), (1,))
    assert (event.time, event.state, event.landing) == (1.0, (0.0,), "bisection")


def test_a_run_that_ended_early_needs_no_times_and_no_end() -> None:
    short = {key: value for key, value in FINE.items() if key not in ("end", "wall_s")} | {"status": "failed"}
    found = trajectory(read(short | {"reason": "it broke"}), REQUEST, "")
    assert (found.status, found.reason, found.end_time, found.end_mode) == ("failed", "it broke", 1.0, (1,))
    found = trajectory(read(short | {"transitions": []}), REQUEST, "")
    assert (found.end_time, found.end_state, found.end_mode) == (0.0, (-1.0,), (-1,))


def test_what_a_program_cannot_do_is_said_in_its_own_words() -> None:
    with pytest.raises(UnsupportedError, match="no square roots"):
        trajectory(read(FINE | {"status": "unsupported", "reason": "no square roots"}), REQUEST, "")
    with pytest.raises(UnavailableError, match="no licence"):
        trajectory(read(FINE | {"status": "unavailable", "reason": "no licence"}), REQUEST, "")


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        ("protocol", 2, "protocol: Input should be less than or equal to 1, not 2"),
        ("protocol", True, "protocol: Input should be a valid integer"),
        ("status", "fine", "status: Input should be 'ok'"),
        ("transitions.0.time", "1.0", "transitions.0.time: Input should be a valid number, not '1.0'"),
        ("transitions.0.time", math.nan, "transitions.0.time: Input should be a finite number"),
        ("transitions.0.time", 2.5, "transitions.0.time: 2.5 is not from 0.0 to 2.0"),
        ("transitions.0.time", -0.5, "transitions.0.time: -0.5 is not from 0.0 to 2.0"),
        ("transitions.0.before", 1, "transitions.0.before: 1 is not -1, the mode that the run was in"),
        ("transitions.0.after", 2, "transitions.0.after: Input should be less than or equal to 1, not 2"),
        ("transitions.0.state", [0.0, 1.0], "transitions.0.state: 2 numbers, wanted 1"),
        ("transitions.0.state", [math.inf], "transitions.0.state.0: Input should be a finite number"),
        ("transitions.0.state", None, "transitions.0.state: Input should be a valid"),
        ("transitions.0.kind", "crossing", "transitions.0.kind: Extra inputs are not permitted"),
        ("end.mode", -1, "end: a run that is ok ends at 2.0 in mode 1, not at 2.0 in -1"),
        ("end.time", 1.5, "end: a run that is ok ends at 2.0"),
        ("end", None, "end: a run that is ok ends at 2.0"),
        ("wall_s", [], "wall_s: 0 times, wanted 1"),
        ("wall_s", [0.1, 0.1], "wall_s: 2 times, wanted 1"),
        ("wall_s", [0.0], "wall_s.0: Input should be greater than 0"),
        ("wall_s", [-1.0], "wall_s.0: Input should be greater than 0"),
        ("max_surface_drift", -1.0, "max_surface_drift: Input should be greater than or equal to 0"),
        ("work", {"steps": -1}, "work.steps: Input should be greater than or equal to 0"),
        ("work", {"steps": 1.5}, "work.steps: Input should be a valid integer"),
        ("program", {"name": "p"}, "program.version: Field required"),
        ("reason", "x" * 3000, "reason: String should have at most 2000 characters"),
    ],
)
def test_a_wrong_value_is_refused_with_its_place(place: str, value: object, words: str) -> None:
    with pytest.raises(ContractError) as refused:
        read(changed(place, value))
    assert str(refused.value).startswith(f"the program's response is refused: {words}")


def test_transitions_are_in_order_and_each_begins_where_the_last_one_ended() -> None:
    first, second = (
        {"time": time, "before": before, "after": -before, "state": [0.0]} for time, before in ((1.5, -1), (0.5, 1))
    )
    with pytest.raises(ContractError, match=r"transitions.1.time: 0.5 is before 1.5"):
        read(FINE | {"transitions": [first, second]})
    with pytest.raises(ContractError, match=r"transitions.1.before: -1 is not 1"):
        read(FINE | {"transitions": [first, first | {"time": 1.75}]})


def refused_or_read(output: bytes) -> Response | None:
    try:
        return read_response(output, REQUEST)
    except ContractError as error:
        words = str(error)
    assert "\n" not in words
    assert len(words) < 500
    return None


@given(st.binary(max_size=400))
def test_any_bytes_are_refused_in_one_line(output: bytes) -> None:
    assert refused_or_read(output) is None


ANY = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=8,
)
PLACES = (
    *("protocol", "program", "program.name", "status", "reason", "transitions", "transitions.0", "transitions.0.time"),
    *(
        "transitions.0.before",
        "transitions.0.state",
        "transitions.0.state.0",
        "end",
        "end.time",
        "end.state",
        "end.mode",
    ),
    *("wall_s", "wall_s.0", "work", "max_surface_drift", "something"),
)


@settings(max_examples=100)
@given(st.sampled_from(PLACES), ANY)
def test_any_value_at_any_place_is_read_as_it_is_or_refused(place: str, value: object) -> None:
    found = refused_or_read(json.dumps(changed(place, value)).encode())
    if found is None:
        return
    made = trajectory(found, REQUEST, "") if found.status not in ("unsupported", "unavailable") else None
    if made is not None:
        times = [event.time for event in made.transitions]
        assert all(math.isfinite(time) for time in times)
        assert all(len(event.state) == 1 and math.isfinite(event.state[0]) for event in made.transitions)


@given(st.integers(0, len(json.dumps(FINE))), st.binary(min_size=1, max_size=3))
def test_a_response_that_was_cut_or_damaged_is_never_half_read(at: int, damage: bytes) -> None:
    whole = json.dumps(FINE).encode()
    if at < len(whole):
        assert refused_or_read(whole[:at]) is None
    found = refused_or_read(whole[:at] + damage + whole[at:])
    assert found is None or found.status == "ok"


@pytest.mark.parametrize("output", [b"[" * 100_000, b'{"a":' * 100_000, b"1e999999", b"9" * 100_000, b"\xef\xbb\xbf{}"])
def test_what_is_deep_or_long_is_refused(output: bytes) -> None:
    assert refused_or_read(output) is None


@pytest.mark.parametrize(("message", "name"), [(Request, "request"), (Response, "response")])
def test_the_published_schemas_are_what_is_checked(message: type, name: str) -> None:
    assert (DOCS / f"{name}.schema.json").read_text(encoding="utf-8") == schema_text(message)


def test_the_schemas_accept_what_is_sent_and_read_and_refuse_the_rest() -> None:
    check_request, check = (fastjsonschema.compile(json.loads(schema_text(kind))) for kind in (Request, Response))
    check_request(json.loads(REQUEST.model_dump_json()))
    check(FINE)
    for wrong in (changed("transitions.0.after", 2), changed("status", "fine")):
        with pytest.raises(fastjsonschema.JsonSchemaValueException):
            check(wrong)


def long_messages() -> Iterator[bytes]:
    """Responses of 5 MiB that are wrong at every place; of those that pass the first look, 1 MiB."""
    whole = json.dumps(FINE | {"transitions": 0, "end": 1}).encode()
    for size in (5 * 2**20, 2**20):
        for item in (b"0", b"[]", b'{"time":1.5}', b'"x"'):
            yield whole.replace(b'"transitions": 0', b'"transitions": [' + b",".join([item] * (size // 4)) + b"]")
        fields = b",".join(b'"k%d":0' % k for k in range(size // 11))
        yield b"{" + fields + b"}"
        yield whole.replace(b'"end": 1', b'"end": {' + fields + b"}")
        yield whole.replace(b'"transitions": 0', b'"transitions": [{' + fields + b"}]")
        yield b"[" * size
        yield whole.replace(b'"end": 1', b'"end": ' + b"1" * size)


def test_a_long_message_is_refused_within_bounds() -> None:
    """One of 15 MiB took 5 GB: an error was made of each wrong entry, with the entry."""
    import resource

    large = REQUEST.model_copy(update={"most_transitions": 100_000})
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for message in long_messages():
        with pytest.raises(ContractError, match="the program's response is refused: ") as caught:
            read_response(message, large)
        assert len(str(caught.value)) < 400
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - used < 2**19  # kB


def test_a_response_of_as_many_transitions_as_were_allowed_is_read() -> None:
    event = FINE["transitions"][0]
    back = {**event, "before": 1, "after": -1}
    message = FINE | {"transitions": [event, back] * 50, "end": {"time": 2.0, "state": [1.0], "mode": -1}}
    assert len(trajectory(read(message), REQUEST, "").transitions) == 100
