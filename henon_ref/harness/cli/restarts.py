"""The command: ``henon-ref restarts CASES [--solvers a,b] [--out out]``.

Exit statuses: see :mod:`henon_ref.commands.exit_status`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from henon_ref.commands.exit_status import DONE, exit_status, parsed, say, writing_into
from henon_ref.commands.typer_app import Cases, Folder, application, examples

app = application()


@app.command(epilog=examples("restarts cases --out reports", "restarts hard --solvers scipy-rk45,ida --jobs 2"))
def main(
    cases: Cases,
    solvers: Annotated[str, typer.Option(help="Libraries, with commas; other rows are kept.", show_default="all")] = "",
    jobs: Annotated[int, typer.Option(min=1, help="Readings at work at once.")] = 2,
    out: Folder = Path("out"),
) -> int:
    """Run every library in every restart, and tell which default another one beats."""
    from henon_ref.harness import registry
    from henon_ref.harness.campaign.case_files import load_cases
    from henon_ref.harness.campaign.options import Options
    from henon_ref.harness.campaign.progress import ProgressLine
    from henon_ref.harness.report.files.folder_lock import locked
    from henon_ref.harness.report.files.manifest import provenance
    from henon_ref.harness.report.files.write import check_index
    from henon_ref.harness.report.text.restarts import FOLDER, read_suite, wrong_defaults
    from henon_ref.harness.studies.restarts.run import run_restarts

    chosen = tuple(registry.check(name.strip()) for name in solvers.split(",")) if solvers else None
    check_index(out / FOLDER)
    words = " ".join(map(str, cases))
    with writing_into(out), locked([out / FOLDER]), ProgressLine() as shown:
        options = Options(solvers=chosen, processes=jobs)
        page = run_restarts(load_cases(cases), options, provenance(f"henon-ref restarts {words}"), out, shown)
    for sentence in wrong_defaults(read_suite(out)):
        say(sentence)
    print(page or "no library to restart, or no reading with a stored truth")
    return DONE


def command(arguments: Sequence[str] | None = None) -> int:
    """Run the command; the exit status."""
    return exit_status(lambda: int(parsed(app, arguments, name="restarts")), name="restarts", arguments=arguments)
