"""Command ``henon-ref simulate CASE [--until T] [--set NAME=VALUE] [--plot FILE] [--csv FILE]``: one run of a case.

``henon-ref demo [--out FILE]`` draws a run of a built-in system. A run that ends before its horizon is reported on
standard error and is not an error. For the exit statuses see :mod:`henon_ref.commands.exit_status`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from henon_ref.atomic_write import replace_file
from henon_ref.commands import application, examples, status_line
from henon_ref.commands.exit_status import DONE, command_of, say
from henon_ref.errors import CaseError
from henon_ref.text import did_you_mean, listed

if TYPE_CHECKING:
    from henon_ref.simulation.solution import Solution
    from henon_ref.simulation.system import System

app, demo_app = application(), application()
STANDARD_OUTPUT = Path("-")


@app.command(
    epilog=examples(
        "simulate fig8",
        "simulate my_case.yaml --reading mine --rtol 1e-6",
        "simulate stribeck_belt --until 40 --set vp=0.5 --plot belt.png",
        "simulate fig8 --csv -",
    )
)
def main(
    case: Annotated[Path, typer.Argument(help="A case file, or a case's name.", show_default=False, metavar="CASE")],
    reading: Annotated[
        str | None,
        typer.Option(help="The reading; the first one if left out.", metavar="NAME", show_default=False),
    ] = None,
    until: Annotated[
        str | None, typer.Option(help="Horizon in seconds; the case's if left out.", metavar="TIME")
    ] = None,
    values: Annotated[
        list[str] | None,
        typer.Option("--set", help="A parameter, or the initial value of a state; may be repeated.", metavar="N=V"),
    ] = None,
    rtol: Annotated[float, typer.Option(help="Tolerance, from 1e-16 to below 1.", metavar="NUMBER")] = 1e-10,
    plot: Annotated[
        Path | None, typer.Option(help="Draw the run: .png, .svg or .pdf.", metavar="FILE", show_default=False)
    ] = None,
    csv: Annotated[
        Path | None,
        typer.Option(
            help="Write the transitions as CSV with all digits instead of printing them; - prints the CSV.",
            metavar="FILE",
        ),
    ] = None,
) -> int:
    """Simulate a case with the reference, and print its transitions."""
    from henon_ref.simulation.system import System

    if plot is not None:
        _check_picture(plot)
    for path, what in ((case, "the case"), (plot, "--plot")):
        if csv is not None and path is not None and csv.resolve() == path.resolve():
            raise CaseError(f"--csv {csv}: this is the file of {what}; name another one")
    run = _run(System.from_case(case, reading), until, values or (), rtol, dense=plot is not None)
    table = run.transitions
    if csv is not None:
        text = table.to_csv(index=False, lineterminator="\n")
        if csv == STANDARD_OUTPUT:
            print(text, end="")
        else:
            _write(csv, text.encode())
    elif len(table):
        print(table.to_string(index=False, float_format=lambda value: f"{value:.12g}"))
    if plot is not None:
        _write_picture(plot, run)
    for path in (csv, plot):
        if path not in (None, STANDARD_OUTPUT):
            say(f"written: {path}")
    if not (csv == STANDARD_OUTPUT and run.success):
        say(repr(run))
    return DONE


@demo_app.command(epilog=examples("demo", "demo --out belt.svg"))
def demo(
    out: Annotated[Path, typer.Option(help="The picture: .png, .svg or .pdf.", metavar="FILE")] = Path("demo.png"),
) -> int:
    """Draw a stick-slip orbit with its transitions: a block on a spring, on a moving belt."""
    _check_picture(out)
    status_line.show("a block on a moving belt")
    from henon_ref.simulation.simulate import simulate
    from henon_ref.simulation.system import System

    belt = System(["x", "v"], {"F": 1, "d": 3, "vb": 0.2}, {"s": "v - vb"}, ["v", "-x - F*s/(1 + d*s*(v - vb))"])
    run = simulate(belt, {"x": 1.5, "v": 0}, until=40)
    _write_picture(out, run)
    status_line.clear()
    found = f"{len(run.transitions)} transitions, {len(run.sticks)} whole sticks in 40 s"
    print(f"{out}: a block on a moving belt, {found}; the program is on the documentation's first page")
    return DONE


def _run(system: System, until: str | None, values: Sequence[str], rtol: float, *, dense: bool) -> Solution:
    """Simulate a reading of a case, with other values of some parameters and initial states."""
    from henon_ref.simulation.simulate import simulate

    own = system.own_start
    assert own is not None  # every case has a start
    parameters: dict[str, str] = {}
    initial: dict[str, str] = {}
    known = [*system.parameters, *system.state]
    for entry in values:
        name, _, value = (part.strip() for part in entry.partition("="))
        if not value or name not in known:
            what = "wanted NAME=VALUE" if not value else f"'{name}' is neither a parameter nor a state"
            meant = did_you_mean(name, known) if value else ""
            raise CaseError(f"--set {entry}: {what}{meant}; names: {listed(known)}")
        if name in (*parameters, *initial):
            raise CaseError(f"--set {entry}: '{name}' is set twice")
        (initial if name in system.state else parameters)[name] = value
    status_line.show(f"simulating to t = {own.until if until is None else until} s; Ctrl-C interrupts")
    run = simulate(
        system,
        {**own.initial, **initial},
        until=until,
        mode=own.mode,
        parameters=parameters or None,
        rtol=rtol,
        dense_output=dense,
    )
    status_line.clear()
    return run


def _write(path: Path, content: bytes) -> None:
    try:
        replace_file(path, content)
    except OSError as error:
        raise CaseError(f"cannot write {path}: {error.strerror or error}") from None


def _check_picture(path: Path) -> None:
    """Raise CaseError if the file name of a figure has a wrong suffix, or its folder does not exist."""
    kinds = (".png", ".svg", ".pdf")
    if path.suffix.lower() not in kinds:
        raise CaseError(f"{path}: the name of a figure must end with one of {listed(kinds)}")
    if not path.parent.is_dir():
        raise CaseError(f"{path}: the folder {path.parent} does not exist")


def _write_picture(path: Path, run: Solution) -> None:
    """Write the figure of a run: the phase portrait with its transitions, and states over time."""
    from henon_ref.figures import style

    with style.figure(4.6, width=10.0) as figure:
        figure.set_layout_engine("constrained")
        grid = figure.add_gridspec(2, 2, width_ratios=(1.15, 1))
        run.plot(ax=figure.add_subplot(grid[:, 0]), transitions=True)
        upper = figure.add_subplot(grid[0, 1])
        lower = figure.add_subplot(grid[1, 1], sharex=upper)
        names = [*run.system.state[:2], *run.system.model.sign_names][:2]
        run.plot_time(*names, ax=[upper, lower][: len(names)])
        if len(names) < 2:
            lower.remove()
    _write(path, style.image(figure, path.suffix.lower()[1:]))


command, demo_command = command_of(app, "simulate"), command_of(demo_app, "demo")
