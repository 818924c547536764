"""The command: ``henon-ref rivals CASES --rows FOLDER [--out out]``.

Exit statuses: see :mod:`henon_ref.commands.exit_status`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from henon_ref.commands.exit_status import DONE, exit_status, parsed, writing_into
from henon_ref.commands.typer_app import Cases, Folder, application, examples

app = application()


@app.command(epilog=examples("rivals cases --rows out --out reports"))
def main(
    cases: Cases,
    rows: Annotated[Path, typer.Option(help="Folder of reports whose rows tell who is timed, and at which settings.")],
    timeout: Annotated[float, typer.Option(min=0.1, help="Seconds of processor time that one run may take.")] = 10.0,
    jobs: Annotated[int, typer.Option(min=1, help="Readings at work at once.")] = 1,
    out: Folder = Path("out"),
) -> int:
    """Time henon in turn with the solvers that reports say are the cheapest for the same digits."""
    from henon_ref.errors import CaseError
    from henon_ref.harness.campaign.case_files import load_cases
    from henon_ref.harness.campaign.options import Options
    from henon_ref.harness.campaign.progress import ProgressLine
    from henon_ref.harness.report.files.folder_lock import locked
    from henon_ref.harness.report.files.manifest import provenance
    from henon_ref.harness.report.files.write import RUNS, check_index
    from henon_ref.harness.report.text.paired_times import FOLDER
    from henon_ref.harness.studies.price.report_pairs import run_paired_times

    loaded = load_cases(cases)
    for case in loaded:
        if not (rows / case.name / RUNS).is_file():
            raise CaseError(f"{rows / case.name / RUNS} is not there: henon-ref compare CASES --out {rows} writes it")
    check_index(out / FOLDER)
    words = f"henon-ref rivals {' '.join(map(str, cases))} --rows FOLDER --jobs {jobs}"
    with writing_into(out), locked([out / FOLDER]), ProgressLine() as shown:
        options = Options(processes=jobs, timeout=timeout)
        page = run_paired_times(loaded, options, provenance(words), out, shown, reports=rows)
    print(page or "no reading in which henon and another solver get to 3 digits")
    return DONE


def command(arguments: Sequence[str] | None = None) -> int:
    """Run the command; the exit status."""
    return exit_status(lambda: int(parsed(app, arguments, name="rivals")), name="rivals", arguments=arguments)
