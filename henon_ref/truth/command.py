"""The command: recompute truths, hold them against what is stored, store them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from henon_ref.errors import CaseError, ModelError
from henon_ref.model.case import Case, Reading
from henon_ref.model.files import read_cases
from henon_ref.text import message
from henon_ref.truth import settle, store
from henon_ref.truth.reference import Truth, TruthError

app = typer.Typer(add_completion=False)
PROOF_SECONDS = 1800.0


@app.command()
def main(
    cases: Annotated[list[Path], typer.Argument(help="Case files, or folders of them.")],
    check: Annotated[bool, typer.Option("--check", help="Write nothing; exit 1 if a stored truth differs.")] = False,
    missing: Annotated[bool, typer.Option("--missing", help="Only what is not stored or out of date.")] = False,
    proof_seconds: Annotated[float, typer.Option(help="Time that one proof may take [s].")] = PROOF_SECONDS,
) -> None:
    """Compute the truth of every reading, compare it with what is stored, and store it under cases/truth.

    A stored truth that the new one agrees with stays as it is, unless more of it is now proven; one that is
    certified stays wherever the new one is not.
    """
    console, errors = Console(), Console(stderr=True)
    try:
        if not proof_seconds >= 0:
            raise CaseError(f"--proof-seconds is a number of seconds from 0 on, not {proof_seconds:g}")
        loaded = read_cases(cases)
    except CaseError as error:
        errors.print(str(error), markup=False, highlight=False, soft_wrap=True)
        raise typer.Exit(2) from None
    failed = False
    with _shown(console) as shown:
        for case in loaded:
            for reading in case.readings:
                failed |= not _one(case, reading, shown, check=check, missing=missing, proof_seconds=proof_seconds)
    raise typer.Exit(int(failed))


@contextmanager
def _shown(console: Console) -> Iterator[Progress]:
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        yield progress


def _one(case: Case, reading: Reading, shown: Progress, *, check: bool, missing: bool, proof_seconds: float) -> bool:
    """One reading; False where something is wrong."""
    folder = store.folder_of(case.path)
    name = f"{case.name}, {reading.name}"
    stored = settle.of_same_mathematics(case, reading, folder)
    current = stored is not None and settle.claimed(stored, reading)
    if current and missing:
        return True
    task = shown.add_task(name, total=1.0)

    def told(stage: str, done: float) -> None:
        shown.update(task, description=f"{name}: {stage}", completed=done)

    try:
        fresh = settle.compute(case, reading, proof_seconds=proof_seconds, progress=told)
    except (TruthError, ModelError) as error:
        _print(shown, f"{name}: {error}")
        return False
    finally:
        shown.remove_task(task)
    return _compared(name, stored, fresh, folder, shown, current=current, check=check)


def _compared(
    name: str, stored: Truth | None, fresh: Truth, folder: Path, shown: Progress, *, current: bool, check: bool
) -> bool:
    """Say how a stored truth and a new one stand to each other; store the new one unless only checking.

    A certified truth is not given up for one that is not.
    """
    faults = [] if stored is None else settle.differences(stored, fresh)
    weaker = stored is not None and stored.certified and not fresh.certified
    stays = check or weaker
    if stored is None:
        verdict, right = ("not stored or out of date" if check else "stored"), not check
    elif faults:
        verdict, right = "differs from what was stored: " + "; ".join(faults[:5]), not stays
    elif not current:
        verdict, right = "was not held against what the case claims now", not stays
    elif (fresh.certified, fresh.proven) > (stored.certified, stored.proven):
        verdict, right = "agrees, and more is proven now", True
    else:
        verdict, right, stays = "agrees with what is stored", not (check and weaker), True
    if not stays:
        try:
            store.save(folder, fresh)
        except OSError as error:
            verdict, right = f"cannot be stored in {folder}: {error.strerror or error}", False
    _print(shown, f"{name}: {_summary(fresh)}; {verdict}{'; what is stored is certified and stays' * weaker}")
    return right


def _summary(truth: Truth) -> str:
    seconds = sum(s for _, _, s in truth.methods)
    proven = "certified" if truth.certified else f"{truth.proven} proven, not certified: {truth.uncertified_because}"
    ending = truth.status + (f" ({truth.reason})" if truth.reason else "")
    return f"{len(truth.transitions)} transitions, {ending}, radius {truth.radius:.1e} s, {proven}, {seconds:.1f} s"


def _print(shown: Progress, text: str) -> None:
    shown.console.print(message(text), markup=False, highlight=False, soft_wrap=True)
