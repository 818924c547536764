"""The command: the JSON Schema of a case file, alone on standard output."""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.commands.exit_status import DONE, exit_status, parsed
from henon_ref.commands.typer_app import application, examples

app = application()
HELP = (
    "Print the JSON Schema of a case file, for editors that complete and check YAML.\n\n"
    "Beside case.schema.json, a case file whose first line is '# yaml-language-server: $schema=case.schema.json' is "
    "checked while it is written."
)


@app.command(help=HELP, epilog=examples("schema > case.schema.json"))
def main() -> int:
    """Print the schema."""
    from henon_ref.casefile.json_schema import schema_text

    print(schema_text(), end="")
    return DONE


def command(arguments: Sequence[str] | None = None) -> int:
    """Run the command; the exit status."""
    return exit_status(lambda: int(parsed(app, arguments, name="schema")), name="schema", arguments=arguments)
