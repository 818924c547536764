"""The command: ``python -m henon_ref.price CASES [--out reports/price]``.

Exit status 0 done, 2 a bad argument, case file or folder, 130 interrupted (finished rows are kept for ``--resume``).
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from henon_ref.errors import HenonRefError

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)

DONE, BAD, INTERRUPTED = 0, 2, 130
# What typer raises for a wrong argument; it exports this one class of them only.
USAGE_ERROR: Any = typer.BadParameter.__base__


@app.command()
def main(
    cases: Annotated[list[Path], typer.Argument(help="Case files, or folders of them.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder of the page and its figures.")] = Path("reports/price"),
    jobs: Annotated[int, typer.Option(min=1, help="Runs at work at once; more than one disturb each other.")] = 1,
    resume: Annotated[bool, typer.Option("--resume", help="Keep the rows of an interrupted list.")] = False,
) -> int:
    """Time every solver at every tolerance, and what landings, effects and horizons cost."""
    from henon_ref.price.command import run

    return run(cases, out, jobs=jobs, resume=resume)


def command(arguments: Sequence[str] | None = None) -> int:
    """Run the command; the exit status."""
    try:
        return int(app(arguments, prog_name="python -m henon_ref.price", standalone_mode=False) or DONE)
    except USAGE_ERROR as error:
        print(f"error: {error.format_message()} (see --help)", file=sys.stderr)
    except HenonRefError as error:
        print(f"error: {error}", file=sys.stderr)
    except OSError as error:
        print(f"error: cannot write {error.filename or ''}: {error.strerror or error}", file=sys.stderr)
    except (KeyboardInterrupt, typer.Abort):
        print("interrupted; finished rows are kept, --resume goes on from them", file=sys.stderr)
        return INTERRUPTED
    return BAD


if __name__ == "__main__":
    sys.exit(command())
