"""The answer: what a reading shows, in sentences made from its rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from decimal import Decimal

from henon_ref.campaign.comparison import Comparison
from henon_ref.campaign.results import ReadingResult
from henon_ref.columns import Row
from henon_ref.report.text.formats import (
    codes,
    digits,
    error,
    listing,
    printed_alike,
    setting,
    significant,
    times_as_long,
)
from henon_ref.report.text.orbits import orbit_sentences
from henon_ref.report.text.ranking import by_solver, floor, most_accurate, name, number, prices, right
from henon_ref.report.text.tables import Samples, samples_of, timed
from henon_ref.score.reference import Expected
from henon_ref.score.sticks import published_partners, sticks
from henon_ref.text import code, markdown

NOT_RUN = ("unsupported", "unavailable")


def answer(comparison: Comparison, result: ReadingResult) -> list[str]:
    """Paragraphs on one reading: accuracy, cost, who is wrong, and the published figures."""
    records = comparison.of_reading(result.reading.name)
    rows, samples = [record.run for record in records], samples_of(records)
    if result.expected is None:
        nothing = f"No truth could be had, so that nothing is scored: {markdown(result.statement.reason)}."
        return [" ".join([nothing, *_unavailable(rows)])]
    paragraphs = [
        " ".join([_accuracy(rows, result, samples), *_cost(rows)]),
        " ".join(_failures(rows)),
        " ".join(published(comparison, result)),
        " ".join(orbit_sentences(result)),
    ]
    return [text for text in paragraphs if text]


def _accuracy(rows: Sequence[Row], result: ReadingResult, samples: Samples) -> str:
    """How many solvers are right, and who is right to the most digits."""
    expected = result.expected
    if expected is None:
        return ""
    if expected.nothing_known:
        return "Nothing is known of the exact run after its start: no run is judged."
    solvers = by_solver(rows)
    tried = [solver for solver, own in solvers.items() if own[-1]["status"] not in NOT_RUN]
    good = [solver for solver in tried if right_at_all(solvers[solver])]
    transitions = sum(event.kind != "graze" for event in expected.transitions)
    where = _where(solvers, good)
    what = "its only transition" if transitions == 1 else f"all {transitions} transitions"
    if expected.partial:
        what += f" up to t = {significant(expected.end_time, 9)} s, where the truth ends,"
    if expected.status == "ok":
        if not transitions:
            touches = len(expected.transitions)
            what = f"touches a surface {_times(touches)} and has" if touches else "has"
            seen = [solver for solver in good if sees_touches(solvers[solver])]
            told = f", {_who(seen, tried, 'report the touch')}" if touches and tried else ""
            ends = f" up to t = {significant(expected.end_time, 9)} s, where the truth ends" if expected.partial else ""
            return f"The exact run {what} no transition{ends}; {_who(good, tried, 'agree')}{where}{told}."
        return f"{_capital(_who(good, tried, f'find {what} in order'))}{where}. {_best(rows, samples)}".strip()
    why = f": {markdown(result.statement.reason).rstrip('.')}" if result.statement.reason else ""
    ends = f"The exact run ends at t = {significant(expected.end_time, 9)} s, {expected.status}{why}."
    found = f", with {what} before it" if transitions and good else ""
    return f"{ends} {_capital(_who(good, tried, 'say so'))}{found}{where}. {_best(rows, samples)}".strip()


def _where(solvers: Mapping[str, Sequence[Row]], good: Sequence[str]) -> str:
    """At which settings the solvers that are right are so; nothing where it is all of them."""
    always = [solver for solver in good if all(row["verdict"] == "right" for row in solvers[solver])]
    if len(always) == len(good):
        return ""
    if len(good) == 1:
        return " at one setting at least"
    return f" at one setting at least, {len(always) or 'none'} of them at every setting"


def _times(count: int) -> str:
    return {1: "once", 2: "twice"}.get(count, f"{count} times")


def sees_touches(rows: Sequence[Row]) -> bool:
    """Whether a solver reports every touch in some right row."""
    return any(row["verdict"] == "right" and row["missed_touches"] == 0 for row in rows)


def _who(good: Sequence[str], tried: Sequence[str], verb: str) -> str:
    """So many of the solvers do something."""
    if not tried:
        return "no solver ran"
    if len(tried) == 1:
        first, _, rest = verb.partition(" ")
        done = f"{first}s" if good else f"does not {first}"
        return f"{code(tried[0])} {done} {rest}".rstrip()
    if len(good) == len(tried):
        return f"all {len(tried)} solvers {verb}"
    return f"{len(good) or 'none'} of {len(tried)} solvers {verb}"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def right_at_all(rows: Sequence[Row]) -> bool:
    """Whether a solver is right at one setting at least."""
    return any(row["verdict"] == "right" for row in rows)


def _best(rows: Sequence[Row], samples: Samples) -> str:
    best = most_accurate(rows)
    if best is None:
        return ""
    worst = error(best["max_time_error_s"], floor(best))
    text = (
        f"**{code(name(best))} is right to {digits(number(best, 'digits'))} digits** "
        f"(worst error {worst} s at {setting(best['rtol'], best['step_s'])})"
    )
    if best["wall_s"] is None:
        return f"{text}, without a time: {markdown(str(best['status_reason']))}."
    text += f" in **{timed(best, samples)}**"
    rest = [row for row in right(rows) if row["solver"] != best["solver"] and row["wall_s"] is not None]
    second = most_accurate(rest)
    if second is None:
        return text + "."
    times = times_as_long(number(second, "wall_s") / number(best, "wall_s"))
    reached = digits(number(second, "digits"))
    return f"{text}; next comes {code(name(second))}, right to {reached} digits in {timed(second, samples)}, {times}."


def _cost(rows: Sequence[Row]) -> list[str]:
    """Cheapest solver per number of digits, in one sentence."""
    reached = [price for price in prices(rows) if price.row is not None]
    if len(by_solver(right(rows))) < 2 or not reached:
        return []
    winners: dict[str, list[str]] = {}
    for price in reached:
        if price.row is not None:
            winners.setdefault(name(price.row), []).append(f"{price.digits}")
    phrases = [f"{code(solver)} for {listing(levels)} digits" for solver, levels in winners.items()]
    return [f"The cheapest is {listing(phrases)}."]


def _failures(rows: Sequence[Row]) -> list[str]:
    """Who is wrong, how, who ran out of time, who cannot do this, and who could not be run."""
    groups: dict[str, list[str]] = {}
    for solver, own in by_solver(rows).items():
        last = own[-1]
        if last["status"] in NOT_RUN:
            if last["status"] == "unsupported":
                groups.setdefault("unsupported", []).append(solver)
            continue
        late = [row for row in own if row["status"] == "timeout"]
        wrong = [row for row in own if row["verdict"] not in ("right", "not judged") and row["status"] != "timeout"]
        if late:
            groups.setdefault("late", []).append(f"{code(solver)} ({_late(late)})")
        if wrong and len(wrong) == len(own):
            groups.setdefault("never", []).append(f"{code(solver)} ({_how(last)})")
        elif wrong and len(wrong) + len(late) == len(own):
            groups.setdefault("finished", []).append(f"{code(solver)} ({_how(wrong[-1])})")
        elif wrong and wrong[-1] is last:
            also = f"; also at {_settings(wrong[:-1])}" if len(wrong) > 1 else ""
            groups.setdefault("tightest", []).append(f"{code(solver)} ({_how(last)}{also})")
        elif wrong:
            groups.setdefault("loose", []).append(f"{code(solver)} (at {_settings(wrong)})")
    sentences = []
    if "never" in groups:
        sentences.append(f"Wrong at every setting: {listing(groups['never'])}.")
    if "finished" in groups:
        sentences.append(f"Wrong at every setting that was finished: {listing(groups['finished'])}.")
    if "tightest" in groups:
        sentences.append(f"Wrong at the tightest setting: {listing(groups['tightest'])}.")
    if "loose" in groups:
        sentences.append(f"Wrong at looser settings only: {listing(groups['loose'])}.")
    if "late" in groups:
        sentences.append(f"Out of time: {listing(groups['late'])}.")
    if "unsupported" in groups:
        sentences.append(f"Unsupported here: {codes(groups['unsupported'])}.")
    return sentences + _unavailable(rows)


def _unavailable(rows: Sequence[Row]) -> list[str]:
    """Which solvers could not be run here, and why, in one sentence."""
    reasons: dict[str, list[str]] = {}
    for solver, own in by_solver(rows).items():
        if own[-1]["status"] == "unavailable":
            reasons.setdefault(str(own[-1]["status_reason"] or "no reason given"), []).append(solver)
    told = [f"{codes(solvers)} ({markdown(reason).rstrip('.')})" for reason, solvers in reasons.items()]
    return [f"Unavailable here: {'; '.join(told)}."] if told else []


def _late(rows: Sequence[Row]) -> str:
    """Where a solver ran out of time; what is tighter was not tried any more."""
    untried = f"; not tried at {_settings(rows[1:])}" if len(rows) > 1 else ""
    return f"at {_settings(rows[:1])}{untried}"


def _settings(rows: Sequence[Row]) -> str:
    return listing([setting(row["rtol"], row["step_s"]) for row in rows])


def _how(row: Row) -> str:
    """What went wrong in a row, in a few words."""
    missed, spurious = number(row, "missed"), number(row, "spurious")
    if row["status"] == "wrong" and missed + spurious > 0:
        return f"{missed:.0f} missed, {spurious:.0f} spurious"
    words = str(row["status"])
    if row["verdict"] in ("ill-conditioned", "not unique"):
        words += f", {row['verdict']}"
    return words


def published(comparison: Comparison, result: ReadingResult) -> list[str]:
    """What became of the source's stick durations in this reading."""
    reading, expected = result.reading, result.expected
    if reading.published is None or not reading.published.stick_durations or expected is None:
        return []
    printed = reading.published.stick_durations
    named = listing([f"{value}" for value in printed])
    exact = [s.duration for s in sticks(expected.transitions, start=expected.start, after=reading.measure_after)]
    if not exact:
        after = f" after t = {reading.measure_after:g} s" if reading.measure_after else ""
        what = f"no stick{after}" if _ends_in_slip(expected) else f"no stick that ends{after or ' within the run'}"
        return [f"The published stick durations ({named} s) have no counterpart: the exact run has {what}."]
    partners = published_partners(exact, [float(value) for value in printed])
    pairs: dict[Decimal, float] = {}
    for partner, own in list(zip(partners, exact, strict=True))[-2 * len(printed) :]:  # the last two of each kind
        value = _nearest(partner or 0.0, printed)
        before = pairs.get(value, own)
        pairs[value] = own if abs(own - float(value)) <= abs(before - float(value)) else before
    values = listing([significant(pairs[value], 11) for value in printed if value in pairs])
    alike = all(printed_alike(duration_s, value) for value, duration_s in pairs.items())
    last = "last sticks take" if len(exact) > len(pairs) else "sticks take" if len(exact) > 1 else "stick takes"
    sentences = [f"The exact run's {last} {values} s where the source prints {named} s"]
    if alike:
        sentences[0] += ": the printed digits hold."
    else:
        off = listing([error(float(value) - pairs[value]) for value in printed if value in pairs])
        sentences[0] += f": they are off by {off} s."
    return sentences + _reproduced(comparison, result, printed)


def _ends_in_slip(expected: Expected) -> bool:
    """Whether no surface is stuck to at the end; unknown, and so not said, of a run without transitions."""
    return bool(expected.transitions) and 0 not in expected.transitions[-1].to_mode


def _nearest(value: float, printed: Sequence[Decimal]) -> Decimal:
    return min(printed, key=lambda candidate: abs(float(candidate) - value))


def _reproduced(comparison: Comparison, result: ReadingResult, printed: Sequence[Decimal]) -> list[str]:
    """The runs that give the printed digits, and the lengths they give."""
    lengths = result.reading.published.stick_lengths if result.reading.published else ()
    sentences = []
    for record in comparison.of_reading(result.reading.name):
        own = [row for row in record.sticks if row["duration_s"] is not None and row["published_s"] is not None]
        if not own or not all(
            printed_alike(number(r, "duration_s"), _nearest(number(r, "published_s"), printed)) for r in own
        ):
            continue
        shown = listing(list(dict.fromkeys(f"{number(row, 'duration_s'):.5f}" for row in own)))
        label = f"{code(name(record.run))} at {setting(record.run['rtol'], record.run['step_s'])}"
        text = f"{label} gives the printed digits: {shown} s"
        if lengths:
            carried = listing(list(dict.fromkeys(f"{number(row, 'length'):.5f}" for row in own)))
            text += f", lengths {carried} (printed {listing([str(value) for value in lengths])})"
        sentences.append(text + ".")
    return sentences[:3]
