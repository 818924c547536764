"""The command: ``python -m henon_ref.paper [--out out/paper]``.

Exit status 1: a claim of the page fails its check; for the others see :mod:`henon_ref.commands.exit_status`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from henon_ref.commands import status_line
from henon_ref.commands.exit_status import DONE, NOT_MET, exit_status, parsed, say, writing_into
from henon_ref.commands.typer_app import Folder, application, examples

app = application()


@app.command(epilog=examples("paper", "paper --out page"))
def main(
    out: Folder = Path("out/paper"),
) -> int:
    """Compute everything the paper computes again, and write the page that sets it against the paper."""
    from henon_ref.harness.report.files.folder_lock import locked
    from henon_ref.harness.report.files.manifest import provenance
    from henon_ref.harness.report.files.write import check_writable
    from henon_ref.harness.studies.paper.page import write_page

    check_writable(out)
    with writing_into(out), locked([out]):
        sections = write_page(out, provenance("python -m henon_ref.paper"), status_line.show)
    status_line.clear()
    failed = [claim for section in sections for claim in section.claims if claim.verdict == "fails"]
    for claim in failed:
        say(f"fails: {claim.where}: {claim.says}")
    return NOT_MET if failed else DONE


def command(arguments: Sequence[str] | None = None) -> int:
    """Run the command; the exit status."""
    return exit_status(lambda: int(parsed(app, arguments, name="paper")), name="paper", arguments=arguments)
