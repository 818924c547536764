"""The command: ``python -m henon_ref.price CASES [--solvers a,b] [--out out/price]``.

Exit statuses: see :mod:`henon_ref.commands.exit_status`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from henon_ref.commands.exit_status import exit_status, parsed, writing_into
from henon_ref.commands.typer_app import FLAG, Cases, Folder, application, examples

app = application()

KEPT = "finished rows are kept, --resume goes on from them"


@app.command(epilog=examples("price fig8", "price fig8 free_coulomb --resume", "price fig8 --solvers all"))
def main(
    cases: Cases,
    solvers: Annotated[
        str, typer.Option(help="Solvers, with commas, beside henon; all: and the peers.", show_default="its own list")
    ] = "",
    out: Folder = Path("out/price"),
    jobs: Annotated[int, typer.Option(min=1, help="Runs at work at once; more than one disturb each other.")] = 1,
    resume: Annotated[
        bool, typer.Option("--resume", help="Keep the rows of an interrupted list.", metavar=FLAG)
    ] = False,
) -> int:
    """Time every solver at every tolerance, and what landings, effects and horizons cost."""
    from henon_ref.harness.campaign.progress import ProgressLine
    from henon_ref.harness.studies.price.run import run

    with writing_into(out, kept=KEPT):
        chosen = [name.strip() for name in solvers.split(",")] if solvers else []
        return run(cases, out, chosen=chosen, jobs=jobs, resume=resume, observer=ProgressLine())


def command(arguments: Sequence[str] | None = None) -> int:
    """Run the command; the exit status."""
    return exit_status(lambda: int(parsed(app, arguments, name="price")), name="price", arguments=arguments, kept=KEPT)
