"""Commands ``check`` and ``truth``: stored reports and truths against fresh ones; exit status 1 if they differ.

``truth`` also stores what it has computed.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import typer

from henon_ref.casefile.case import Case, Reading
from henon_ref.commands import FLAG, Cases, application, examples, status_line
from henon_ref.commands.exit_status import DONE, NOT_MET, command_of, say
from henon_ref.errors import CaseError, ModelError
from henon_ref.harness.campaign.campaign import compare_all
from henon_ref.harness.campaign.comparison import Comparison
from henon_ref.harness.campaign.options import Options, load_cases
from henon_ref.harness.registry import is_peer
from henon_ref.harness.report.case_report import write_report
from henon_ref.harness.report.folder import MANIFEST, MATRIX, PAGE, REPORT, ROWS, RUNS
from henon_ref.harness.report.folder_report import content
from henon_ref.harness.report.manifest import provenance
from henon_ref.harness.report.matrix import read_matrix, read_report
from henon_ref.harness.report.rendering import embedded, read_embedded, unpacked
from henon_ref.harness.result_files import rows_in_file
from henon_ref.harness.rows import Key, RunRow
from henon_ref.harness.score.ranking import floor
from henon_ref.harness.table import setting
from henon_ref.harness.truth import compute, store
from henon_ref.harness.truth.reference import Truth, TruthError
from henon_ref.text import message

check_app, truth_app = application(), application()


def differences(stored: Path, fresh: Path) -> list[str]:
    """List the differences between the stored and the fresh report folder of a case.

    The rows of a peer (:func:`henon_ref.harness.registry.is_peer`) are compared only if the fresh report has rows of
    it, since its library may not be installed.
    """
    if not (stored / RUNS).exists():
        return [f"there is no report in {stored}"]
    manifest, rows = read_report(stored)
    old, new = ({row.key: row for row in own} for own in (rows, rows_in_file(RunRow, fresh / RUNS)))
    if len({(folder / RUNS).read_text(encoding="utf-8").partition("\n")[0] for folder in (stored, fresh)}) > 1:
        return [f"the columns of {stored / RUNS} are those of another version"]
    ran = {row.solver for row in new.values()}
    old = {key: row for key, row in old.items() if row.solver in ran or not is_peer(row.solver)}
    found = [f"{_label(key)} is stored, but is no longer run" for key in old if key not in new]
    found += [f"{_label(key)} is not stored" for key in new if key not in old]
    for key in old.keys() & new.keys():
        found += [f"{_label(key)}: {words}" for words in row_differences(old[key], new[key])]
    found += text_differences(stored / REPORT, fresh / REPORT)
    listed = manifest.get("files")
    if not isinstance(listed, list):
        return [*found, f"{MANIFEST} has no list of files"]
    found += [
        f"the file {name} is missing" for name in listed if name not in ROWS and not (stored / str(name)).exists()
    ]
    return found


def row_differences(old: RunRow, new: RunRow) -> Iterator[str]:
    """Yield the differences between two rows of the same run, except those that depend on the machine."""
    if "timeout" in (old.status, new.status):
        return
    if old.verdict != "right" or new.verdict != "right":
        # After its first error the rest of a run depends on the last bit, so only verdict and status are compared.
        if old.verdict != new.verdict or old.status != new.status:
            yield f"was {old.status} ({old.verdict}), is {new.status} ({new.verdict})"
        return
    equal = ("status", "reference_transitions", "matched", "missed", "spurious", "stick_count")
    for column in (*equal, "max_time_error_s", "max_stick_error_s"):
        was, is_now = getattr(old, column), getattr(new, column)
        if column in equal or was is None or is_now is None:
            if was != is_now:
                yield f"{column} was {was}, is {is_now}"
        # Rounding differs between processors, and so do errors of a few thousand times the smallest claimable error.
        elif max(was, is_now) > max(1e4 * floor(old), 10.0 * min(was, is_now)):
            yield f"{column} was {was:.2e}, is {is_now:.2e}"


def text_differences(stored: Path, fresh: Path) -> list[str]:
    """List the sections on model and truth that differ."""
    old, new = (_sections(_read(path)) for path in (stored, fresh))
    return [f"{name}: the text differs" for name in old | new if old.get(name) != new.get(name)]


def page_differences(reports: Path) -> list[str]:
    """Check that the page of a folder, if it has one, shows the contents of the matrix and the reports."""
    page = reports / PAGE
    if not page.exists():
        return []
    shown = read_embedded(_read(page))
    made = unpacked(embedded(content(reports, read_matrix(reports))))
    return [] if shown == made else [f"{page} does not agree with {MATRIX} and the reports in its folder"]


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")  # a damaged file differs
    except OSError as error:
        raise CaseError(f"cannot be read: {error.strerror or error}", file=str(path)) from error


def _sections(text: str) -> dict[str, str]:
    """Return the title, and the text below every heading Truth and Model by reading and heading."""
    found = {"title": text.split("\n", 1)[0]}
    reading = ""
    for block in re.split(r"^(?=#{2,3} )", text, flags=re.MULTILINE)[1:]:
        heading, _, body = block.partition("\n")
        name = heading.lstrip("# ")
        if name in ("Truth", "Model"):
            found[f"{reading} {name}".strip()] = body.strip()
        elif heading.startswith("## ") and re.fullmatch(r"[a-z0-9_]+", name):
            reading = name
    return found


def _label(key: Key) -> str:
    _, reading, solver, rtol, step = key
    return f"{reading}, {solver} at {setting(rtol, step)}"


def all_differences(paths: Sequence[Path], reports: Path, fresh: Path | None) -> list[str]:
    """List the differences between the reports of cases and a fresh comparison; if ``fresh`` is None, run it."""
    cases = load_cases(paths)
    with tempfile.TemporaryDirectory() as made:
        if fresh is None:
            origin, fresh = provenance(""), Path(made)

            def keep(comparison: Comparison) -> None:
                write_report(comparison, origin, Path(made))

            compare_all(cases, Options(repeats=1), keep)
        missing = [case.name for case in cases if not (fresh / case.name / RUNS).exists()]
        if missing:
            raise CaseError(f"{fresh} has no report of {', '.join(missing)}")
        found = [f"{c.name}: {w}" for c in cases for w in differences(reports / c.name, fresh / c.name)]
        return found + page_differences(reports)


@check_app.command(epilog=examples("check fig8", "check cases --fresh out"))
def check(
    cases: Cases,
    reports: Annotated[Path, typer.Option(help="Folder of the reports.", metavar="FOLDER")] = Path("reports"),
    fresh: Annotated[
        Path | None,
        typer.Option(
            help="Folder with the reports of a new comparison. If omitted, the cases are run again.", metavar="FOLDER"
        ),
    ] = None,
) -> int:
    """Check stored reports against a fresh comparison, except for wall times."""
    found = all_differences(cases, reports, fresh)
    for words in found:
        say(words)
    return NOT_MET if found else DONE


check_command = command_of(check_app, "check")


@truth_app.command(
    help="Compute the truth of every reading, compare it with the stored truth, and store it in cases/truth.\n\n"
    "If the new truth agrees with the stored one, the stored one is kept, unless the new one proves more. A certified "
    "stored truth is never replaced by a new one that is not certified.",
    epilog=examples("truth my_case.yaml", "truth cases --dry-run", "truth cases --missing"),
)
def truth(
    cases: Cases,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Write nothing; exit with 1 if a stored truth differs.", metavar=FLAG)
    ] = False,
    missing: Annotated[
        bool, typer.Option("--missing", help="Compute only truths that are missing or out of date.", metavar=FLAG)
    ] = False,
    proof_seconds: Annotated[float, typer.Option(help="Limit on the time of one proof.", metavar="SECONDS")] = 1800.0,
) -> int:
    if not proof_seconds >= 0:
        raise CaseError(f"--proof-seconds is a number of seconds from 0 on, not {proof_seconds:g}")
    failed = False
    for case in load_cases(cases, check_solvers=False):
        for reading in case.readings:
            failed |= not _one(case, reading, dry_run=dry_run, missing=missing, proof_seconds=proof_seconds)
    return NOT_MET if failed else DONE


truth_command = command_of(truth_app, "truth")


def _stored(case: Case, reading: Reading, folder: Path) -> tuple[Truth | None, str, bool]:
    """Read the stored truth of a reading; print a message if the file is damaged.

    Return the truth, possibly from a damaged file (None if nothing is stored for the mathematics of the reading); the
    damage of the file (empty if it is intact); and whether the truth is intact, and was checked against the present
    claims of the case.
    """
    try:
        truth, fault = store.load(folder, case.name, reading.name), ""
    except store.StoredTruthError as error:
        compute.tell(error)
        truth, fault = error.content, error.reason
    if truth is None or truth.mathematics_hash != reading.mathematics_hash:
        return None, fault, False
    return truth, fault, not fault and compute.claimed(truth, reading)


def _one(case: Case, reading: Reading, *, dry_run: bool, missing: bool, proof_seconds: float) -> bool:
    """Compute and store the truth of one reading; return False if an error or a difference is found."""
    name = f"{case.name}, {reading.name}"
    old, fault, current = _stored(case, reading, store.folder_of(case.path))
    if current and missing:
        return True

    def report(stage: str, done: float) -> None:
        status_line.show(f"{name}: {stage}, {done:.0%}")

    try:
        fresh = compute.compute(case, reading, proof_seconds=proof_seconds, progress=report)
    except (TruthError, ModelError) as error:
        verdict, right = str(error), False
    else:
        found, right = _compared(old, fault, current, fresh, store.folder_for_new(case.path), dry_run=dry_run)
        verdict = f"{_summary(fresh)}; {found}"
    finally:
        status_line.clear()
    print(message(f"{name}: {verdict}"))
    return right


def _compared(
    old: Truth | None, fault: str, current: bool, fresh: Truth, folder: Path, *, dry_run: bool
) -> tuple[str, bool]:
    """Compare a stored truth with a new one, and store the new one if required; return the verdict and success."""
    faults = [*([] if old is None else compute.differences(old, fresh)), *([fault] if fault else [])]
    weaker = old is not None and old.certified and not fresh.certified
    stays = dry_run or weaker
    if old is None and not fault:
        verdict, right = ("not stored or out of date" if dry_run else "stored"), not dry_run
    elif faults:
        verdict, right = "differs from the stored truth: " + "; ".join(faults[:5]), not stays
    elif not current:
        verdict, right = "the stored truth was not checked against the present claims of the case", not stays
    elif old is not None and (fresh.certified, fresh.proven) > (old.certified, old.proven):
        verdict, right = "agrees with the stored truth, and more is proven now", True
    else:
        verdict, right, stays = "agrees with the stored truth", not (dry_run and weaker), True
    if not stays:
        try:
            store.save(folder, fresh)
        except OSError as error:
            verdict, right = f"cannot be stored in {folder}: {error.strerror or error}", False
    return f"{verdict}{'; the stored truth is certified and is kept' * weaker}", right


def _summary(truth: Truth) -> str:
    seconds = sum(s for _, _, s in truth.methods)
    proven = "certified" if truth.certified else f"{truth.proven} proven, not certified: {truth.uncertified_because}"
    ending = truth.status + (f" ({truth.reason})" if truth.reason else "")
    return f"{len(truth.transitions)} transitions, {ending}, radius {truth.radius:.1e} s, {proven}, {seconds:.1f} s"
