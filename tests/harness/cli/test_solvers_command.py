"""The list of solvers, and the schema alone on standard output."""

from __future__ import annotations

import json
from importlib import metadata

from henon_ref.baselines.heyoka_taylor import HeyokaTaylor
from henon_ref.casefile.json_schema import case_schema
from henon_ref.harness import registry
from henon_ref.harness.cli.lists import schema_command as schema
from henon_ref.harness.cli.lists import solvers_command as solvers


def test_every_solver_is_listed_with_version_and_options(capsys):
    assert solvers([]) == 0
    lines = capsys.readouterr().out.splitlines()
    listed = [line.split()[0] for line in lines[1:] if " is unavailable: " not in line]
    assert listed == list(registry.names())
    by_name = {line.split()[0]: " ".join(line.split()) for line in lines}
    scipy = metadata.version("scipy")
    assert by_name["scipy-dop853"] == f"scipy-dop853 scipy {scipy} tolerances offset by default"
    assert by_name["scipy-sign"] == f"scipy-sign scipy {scipy} tolerances by default"
    assert by_name["henon-rk4"].endswith(" step by default")
    assert by_name["henon-brent"].endswith(" tolerances when named")


def test_a_library_that_cannot_be_imported_is_told_as_its_rows_tell_it(monkeypatch, capsys):
    def load(self):
        raise ImportError("no heyoka here")

    monkeypatch.setattr(HeyokaTaylor, "load", load)
    assert solvers([]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "heyoka is unavailable: heyoka is not installed" in lines
    assert "heyoka+fastmath is unavailable: heyoka is not installed" in lines


def test_a_strangers_solver_that_cannot_be_loaded_is_told_in_one_line(monkeypatch, capsys):
    point = metadata.EntryPoint("own", "no_such_module:SOLVER", registry.GROUP)
    monkeypatch.setattr(registry, "_third_party", lambda: {"own": point})
    assert solvers([]) == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("own is unavailable: ")]
    assert "no_such_module" in line


def test_the_schema_is_alone_on_standard_output(capsys):
    assert schema([]) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out) == case_schema()
    assert captured.err == ""
