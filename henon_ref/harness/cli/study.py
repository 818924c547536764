"""Command ``study``: run a study; the exit status is 1 if a claim of its page fails its check."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from henon_ref.commands import FLAG, application, examples, status_line
from henon_ref.commands.exit_status import DONE, NOT_MET, exit_status, parsed, say, writing_into
from henon_ref.harness.cli.compare import ROWS_KEPT, names
from henon_ref.harness.studies.study import STUDIES, Study, StudyRequest

app = application()

NAME_HELP = " ".join(f"{name}: {own.summary}" for name, own in STUDIES.items())


@app.command(
    epilog=examples(
        "study price fig8",
        "study paired-times cases --rows out --out reports",
        "study atlas hard --solvers henon,my-solver",
        "study restarts cases --out reports",
        "study paper",
    )
)
def main(
    study: Annotated[str, typer.Argument(help=NAME_HELP, show_default=False, metavar="NAME")],
    cases: Annotated[
        list[Path] | None, typer.Argument(help="Case files, or folders of them.", show_default=False, metavar="CASE")
    ] = None,
    solvers: Annotated[
        str | None,
        typer.Option(
            help="Solvers, separated by commas; 'all' also includes the installed peers. If omitted: the study's own.",
            metavar="NAMES",
        ),
    ] = None,
    rows: Annotated[
        Path | None, typer.Option(help="Folder of reports that name the solvers for paired-times.", metavar="FOLDER")
    ] = None,
    timeout: Annotated[
        float | None,
        typer.Option(min=0.1, help="Limit on the processor time of a run. If omitted: 10 s.", metavar="SECONDS"),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, help="Concurrent runs. If omitted: 1 if times are compared, otherwise 2.", metavar="N"),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue an interrupted study from its finished rows.", metavar=FLAG)
    ] = False,
    out: Annotated[Path, typer.Option(help="Folder in which the study has a subfolder.", metavar="FOLDER")] = Path(
        "out"
    ),
) -> int:
    """Run a study, and write its page into a folder of the study."""
    from henon_ref.harness import registry
    from henon_ref.harness.campaign.options import Options, load_cases
    from henon_ref.harness.campaign.progress import ProgressLine
    from henon_ref.harness.cli.compare_cases import discard
    from henon_ref.harness.report.folder import check_writable, locked
    from henon_ref.harness.report.manifest import provenance

    own = STUDIES.get(study)
    if own is None:
        raise typer.BadParameter(f"unknown study '{study}'; the studies are {', '.join(STUDIES)}")
    given = {"cases": cases, "solvers": solvers, "rows": rows, "timeout": timeout, "jobs": jobs, "resume": resume}
    chosen = names(solvers, "--solvers")
    for name in chosen or ():
        if name != registry.ALL:
            registry.check(name)
    _check_taken(study, own, [name for name, value in given.items() if value])
    limit = timeout or Options().timeout
    options = Options(solvers=chosen, timeout=limit, processes=jobs or own.jobs, resume=resume)
    loaded, folder = load_cases(cases) if cases else [], out / own.folder
    check_writable(folder)
    words = ["henon-ref study", study, *map(str, cases or ()), *([f"--solvers {solvers}"] if solvers else [])]
    words += [*(["--rows FOLDER"] if rows else []), *([f"--timeout {timeout:g}"] if timeout else [])]
    origin = provenance(" ".join(words))
    kept = ROWS_KEPT if "resume" in own.takes else ""
    with writing_into(folder, kept=kept), locked([folder]), ProgressLine(sys.stderr) as shown:
        made = own.make(StudyRequest(loaded, options, origin, folder, shown, rows))
        discard(folder, loaded)
    status_line.clear()
    for remark in made.remarks:
        say(remark)
    print(made.page or own.nothing)
    return DONE if made.holds else NOT_MET


def _check_taken(name: str, study: Study, given: Sequence[str]) -> None:
    """Check that a study receives the arguments that it requires, and no argument that it does not take."""
    for option in given:
        if option not in study.takes:
            what = "no cases" if option == "cases" else f"no --{option}"
            taken = ", ".join(f"--{one}" for one in (*study.takes, "out") if one != "cases")
            raise typer.BadParameter(f"study {name} takes {what}; its options are {taken}")
    for needed in ("cases", "rows"):
        if needed in study.takes and needed not in given:
            what = "the cases to run" if needed == "cases" else "--rows, a folder of existing reports"
            raise typer.BadParameter(f"study {name} requires {what}")


def command(arguments: Sequence[str] | None = None) -> int:
    words = sys.argv[1:] if arguments is None else arguments
    kept = ROWS_KEPT if any("resume" in STUDIES[word].takes for word in words[:1] if word in STUDIES) else ""
    return exit_status(lambda: int(parsed(app, arguments, name="study")), name="study", arguments=arguments, kept=kept)
