"""Command ``truth``: recompute truths, compare them with the stored ones, and store them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from henon_ref.casefile.case import Case, Reading
from henon_ref.commands import FLAG, Cases, application, examples, status_line
from henon_ref.commands.exit_status import DONE, NOT_MET, command_of
from henon_ref.errors import CaseError, ModelError
from henon_ref.harness.campaign.options import load_cases
from henon_ref.harness.truth import compute, store
from henon_ref.harness.truth.reference import Truth, TruthError
from henon_ref.text import message

app = application()
PROOF_SECONDS = 1800.0


@app.command(
    help="Compute the truth of every reading, compare it with the stored truth, and store it in cases/truth.\n\n"
    "If the new truth agrees with the stored one, the stored one is kept, unless the new one proves more. A certified "
    "stored truth is never replaced by a new one that is not certified.",
    epilog=examples("truth my_case.yaml", "truth cases --dry-run", "truth cases --missing"),
)
def main(
    cases: Cases,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Write nothing; exit with 1 if a stored truth differs.", metavar=FLAG)
    ] = False,
    missing: Annotated[
        bool, typer.Option("--missing", help="Compute only truths that are missing or out of date.", metavar=FLAG)
    ] = False,
    proof_seconds: Annotated[
        float, typer.Option(help="Limit on the time of one proof.", metavar="SECONDS")
    ] = PROOF_SECONDS,
) -> int:
    if not proof_seconds >= 0:
        raise CaseError(f"--proof-seconds is a number of seconds from 0 on, not {proof_seconds:g}")
    failed = False
    for case in load_cases(cases, check_solvers=False):
        for reading in case.readings:
            failed |= not _one(case, reading, dry_run=dry_run, missing=missing, proof_seconds=proof_seconds)
    return NOT_MET if failed else DONE


command = command_of(app, "truth")


class Stored(NamedTuple):
    """Stored truth of a reading, if any."""

    truth: Truth | None
    """The truth, possibly from a damaged file; None if nothing is stored for the mathematics of the reading."""
    fault: str
    """Damage of the file; empty if it is intact."""
    current: bool
    """Whether the truth is intact, and was checked against the present claims of the case."""


def _stored(case: Case, reading: Reading, folder: Path) -> Stored:
    """Read the stored truth of a reading; print a message if the file is damaged."""
    try:
        truth, fault = store.load(folder, case.name, reading.name), ""
    except store.StoredTruthError as error:
        compute.tell(error)
        truth, fault = error.content, error.reason
    if truth is None or truth.mathematics_hash != reading.mathematics_hash:
        return Stored(None, fault, False)
    return Stored(truth, fault, not fault and compute.claimed(truth, reading))


def _one(case: Case, reading: Reading, *, dry_run: bool, missing: bool, proof_seconds: float) -> bool:
    """Compute and store the truth of one reading; return False if an error or a difference is found."""
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
    """Compare a stored truth with a new one, and store the new one if required; return the verdict and success."""
    old, fault = stored.truth, stored.fault
    faults = [*([] if old is None else compute.differences(old, fresh)), *([fault] if fault else [])]
    weaker = old is not None and old.certified and not fresh.certified
    stays = dry_run or weaker
    if old is None and not fault:
        verdict, right = ("not stored or out of date" if dry_run else "stored"), not dry_run
    elif faults:
        verdict, right = "differs from the stored truth: " + "; ".join(faults[:5]), not stays
    elif not stored.current:
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
