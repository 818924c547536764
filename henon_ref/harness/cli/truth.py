"""The command: recompute truths, hold them against what is stored, store them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from henon_ref.casefile.case import Case, Reading
from henon_ref.casefile.files import read_cases
from henon_ref.commands import status_line
from henon_ref.commands.exit_status import DONE, NOT_MET, command_of
from henon_ref.commands.typer_app import FLAG, Cases, application, examples
from henon_ref.errors import CaseError, ModelError
from henon_ref.harness.truth import compute, store
from henon_ref.harness.truth.reference import Truth, TruthError
from henon_ref.text import message

app = application()
PROOF_SECONDS = 1800.0
HELP = (
    "Compute the truth of every reading, compare it with what is stored, and store it under cases/truth.\n\n"
    "A stored truth that the new one agrees with stays as it is, unless more of it is now proven. One that is "
    "certified stays wherever the new one is not."
)


@app.command(help=HELP, epilog=examples("truth my_case.yaml", "truth cases --dry-run", "truth cases --missing"))
def main(
    cases: Cases,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Write nothing; exit with 1 if a stored truth differs.", metavar=FLAG)
    ] = False,
    missing: Annotated[
        bool, typer.Option("--missing", help="Only what is not stored or out of date.", metavar=FLAG)
    ] = False,
    proof_seconds: Annotated[
        float, typer.Option(help="Seconds that one proof may take.", metavar="SECONDS")
    ] = PROOF_SECONDS,
) -> int:
    """Compute truths, compare them with what is stored, and store them."""
    if not proof_seconds >= 0:
        raise CaseError(f"--proof-seconds is a number of seconds from 0 on, not {proof_seconds:g}")
    failed = False
    for case in read_cases(cases):
        for reading in case.readings:
            failed |= not _one(case, reading, dry_run=dry_run, missing=missing, proof_seconds=proof_seconds)
    return NOT_MET if failed else DONE


command = command_of(app, "truth")


class Stored(NamedTuple):
    """What lies in the place of a reading's truth."""

    truth: Truth | None
    """The truth of the reading's mathematics, or what a damaged file says of it; None where there is neither."""
    fault: str
    """Why the file is not to be believed."""
    current: bool
    """Whether nothing is wrong with it, and it has been held against what the case claims now."""


def _stored(case: Case, reading: Reading, folder: Path) -> Stored:
    """What lies in a folder; a damaged file is told."""
    try:
        truth, fault = store.load(folder, case.name, reading.name), ""
    except store.StoredTruthError as error:
        compute.tell(error)
        truth, fault = error.content, error.reason
    if truth is None or truth.mathematics_hash != reading.mathematics_hash:
        return Stored(None, fault, False)
    return Stored(truth, fault, not fault and compute.claimed(truth, reading))


def _one(case: Case, reading: Reading, *, dry_run: bool, missing: bool, proof_seconds: float) -> bool:
    """One reading; False where something is wrong."""
    name, stored = f"{case.name}, {reading.name}", _stored(case, reading, store.folder_of(case.path))
    if stored.current and missing:
        return True

    def report(stage: str, done: float) -> None:
        status_line.show(f"{name}: {stage}, {done:.0%}")

    try:
        fresh = compute.compute(case, reading, proof_seconds=proof_seconds, progress=report)
    except (TruthError, ModelError) as error:
        verdict, right = str(error), False
    else:
        found, right = _compared(stored, fresh, store.folder_for_new(case.path), dry_run=dry_run)
        verdict = f"{_summary(fresh)}; {found}"
    finally:
        status_line.clear()
    print(message(f"{name}: {verdict}"))
    return right


def _compared(stored: Stored, fresh: Truth, folder: Path, *, dry_run: bool) -> tuple[str, bool]:
    """How a stored truth and a new one stand to each other, and whether that is right.

    The new one is stored unless nothing is to be written; a certified one is not given up for one that is not.
    """
    old, fault = stored.truth, stored.fault
    faults = [*([] if old is None else compute.differences(old, fresh)), *([fault] if fault else [])]
    weaker = old is not None and old.certified and not fresh.certified
    stays = dry_run or weaker
    if old is None and not fault:
        verdict, right = ("not stored or out of date" if dry_run else "stored"), not dry_run
    elif faults:
        verdict, right = "differs from what was stored: " + "; ".join(faults[:5]), not stays
    elif not stored.current:
        verdict, right = "was not held against what the case claims now", not stays
    elif old is not None and (fresh.certified, fresh.proven) > (old.certified, old.proven):
        verdict, right = "agrees, and more is proven now", True
    else:
        verdict, right, stays = "agrees with what is stored", not (dry_run and weaker), True
    if not stays:
        try:
            store.save(folder, fresh)
        except OSError as error:
            verdict, right = f"cannot be stored in {folder}: {error.strerror or error}", False
    return f"{verdict}{'; what is stored is certified and stays' * weaker}", right


def _summary(truth: Truth) -> str:
    seconds = sum(s for _, _, s in truth.methods)
    proven = "certified" if truth.certified else f"{truth.proven} proven, not certified: {truth.uncertified_because}"
    ending = truth.status + (f" ({truth.reason})" if truth.reason else "")
    return f"{len(truth.transitions)} transitions, {ending}, radius {truth.radius:.1e} s, {proven}, {seconds:.1f} s"
