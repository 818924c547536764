"""Command ``henon-ref demo [--out FILE]``: figure of a stick-slip orbit with its transitions.

For the exit statuses see :mod:`henon_ref.commands.exit_status`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from henon_ref.commands import status_line
from henon_ref.commands.exit_status import DONE, command_of
from henon_ref.commands.simulate import check_picture, write_picture
from henon_ref.commands.typer_app import application, examples

app = application()


@app.command(epilog=examples("demo", "demo --out belt.svg"))
def main(
    out: Annotated[Path, typer.Option(help="The picture: .png, .svg or .pdf.", metavar="FILE")] = Path("demo.png"),
) -> int:
    """Draw a stick-slip orbit with its transitions: a block on a spring, on a moving belt."""
    check_picture(out)
    status_line.show("a block on a moving belt")
    from henon_ref.simulation.simulate import simulate
    from henon_ref.simulation.system import System

    belt = System(["x", "v"], {"F": 1, "d": 3, "vb": 0.2}, {"s": "v - vb"}, ["v", "-x - F*s/(1 + d*s*(v - vb))"])
    run = simulate(belt, {"x": 1.5, "v": 0}, until=40)
    write_picture(out, run)
    status_line.clear()
    found = f"{len(run.transitions)} transitions, {len(run.sticks)} whole sticks in 40 s"
    print(f"{out}: a block on a moving belt, {found}; the program is on the documentation's first page")
    return DONE


command = command_of(app, "demo")
