"""The command: ``henon-ref atlas CASES [--solvers a,b] [--out out]``.

Exit statuses: see :mod:`henon_ref.commands.exit_status`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from henon_ref.commands.exit_status import DONE, exit_status, parsed, writing_into
from henon_ref.commands.typer_app import FLAG, Cases, Folder, application, examples

app = application()

KEPT = "finished rows are kept, --resume goes on from them"


@app.command(epilog=examples("atlas cases --out reports", "atlas hard --solvers henon,my-solver"))
def main(
    cases: Cases,
    solvers: Annotated[
        str, typer.Option(help="Solvers, with commas; all: and the peers.", show_default="those of compare")
    ] = "",
    timeout: Annotated[float, typer.Option(min=0.1, help="Seconds of processor time that one run may take.")] = 10.0,
    jobs: Annotated[int, typer.Option(min=1, help="Runs at work at once.")] = 2,
    out: Folder = Path("out"),
    resume: Annotated[
        bool, typer.Option("--resume", help="Keep the rows of an interrupted atlas.", metavar=FLAG)
    ] = False,
) -> int:
    """Run solvers on ever closer grazes and pairs of roots, at tolerances from 1e-3 to 1e-13."""
    from henon_ref.harness import registry
    from henon_ref.harness.campaign.case_files import load_cases
    from henon_ref.harness.campaign.options import Options
    from henon_ref.harness.campaign.progress import ProgressLine
    from henon_ref.harness.cli.compare_cases import discard
    from henon_ref.harness.report.files.folder_lock import locked
    from henon_ref.harness.report.files.manifest import provenance
    from henon_ref.harness.report.files.write import check_index
    from henon_ref.harness.studies.atlas.page import FOLDER
    from henon_ref.harness.studies.atlas.run import families, run_atlas

    named = [name.strip() for name in solvers.split(",")] if solvers else []
    chosen = tuple(map(registry.check, registry.expanded(named))) or None
    loaded = load_cases(cases)
    check_index(out / FOLDER)
    words = " ".join(
        [*map(str, cases)]
        + (["--solvers", ",".join(named)] if named else [])
        + ([f"--timeout {timeout:g}"] if timeout != Options().timeout else [])
    )
    with writing_into(out, kept=KEPT), locked([out / FOLDER]), ProgressLine() as shown:
        options = Options(solvers=chosen, processes=jobs, timeout=timeout, resume=resume, keep_journals=True)
        page = run_atlas(loaded, options, provenance(f"henon-ref atlas {words}"), out, shown)
        discard(out / FOLDER, [family.case for family in families(loaded)])
    print(page or "no case whose readings differ in a distance alone, or no solver that has a tolerance")
    return DONE


def command(arguments: Sequence[str] | None = None) -> int:
    """Run the command; the exit status."""
    return exit_status(lambda: int(parsed(app, arguments, name="atlas")), name="atlas", arguments=arguments, kept=KEPT)
