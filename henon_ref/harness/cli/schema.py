"""The command: the JSON Schema of a case file, alone on standard output."""

from __future__ import annotations

from henon_ref.commands.exit_status import DONE, command_of
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


command = command_of(app, "schema")
