"""The command: ``python -m henon_ref.paper [--out reports/paper]``.

Exit status 0 done, 1 a claim of the page fails its check, 2 a bad argument or a folder that cannot be written.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from henon_ref.errors import HenonRefError

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)

DONE, FAILS, BAD = 0, 1, 2
# What typer raises for a wrong argument; it exports this one class of them only.
USAGE_ERROR: Any = typer.BadParameter.__base__


@app.command()
def main(
    out: Annotated[Path, typer.Option(help="Folder of the page and its figures.")] = Path("reports/paper"),
) -> int:
    """Compute everything the paper computes again, and write the page that sets it against the paper."""
    from rich.console import Console

    from henon_ref.paper.page import write_page
    from henon_ref.report.manifest import provenance
    from henon_ref.report.write import check_writable

    check_writable(out)
    console = Console(stderr=True)
    with console.status("the paper, computed again") as status:
        sections = write_page(out, provenance("python -m henon_ref.paper"), lambda name: status.update(name))
    failed = [claim for section in sections for claim in section.claims if claim.verdict == "fails"]
    for claim in failed:
        print(f"fails: {claim.where}: {claim.says}", file=sys.stderr)
    return FAILS if failed else DONE


def command(arguments: Sequence[str] | None = None) -> int:
    """Run the command; the exit status."""
    try:
        return int(app(arguments, prog_name="python -m henon_ref.paper", standalone_mode=False) or DONE)
    except USAGE_ERROR as error:
        print(f"error: {error.format_message()} (see --help)", file=sys.stderr)
    except HenonRefError as error:
        print(f"error: {error}", file=sys.stderr)
    except OSError as error:
        print(f"error: cannot write {error.filename or ''}: {error.strerror or error}", file=sys.stderr)
    return BAD


if __name__ == "__main__":
    sys.exit(command())
