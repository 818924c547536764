"""``new-solver`` writes a package that works without changes, completely or not at all."""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from pathlib import Path

import pytest
from editable import install
from programs import RAMP

from henon_ref.harness.cli import new_solver
from henon_ref.harness.cli.new_solver import command

ROOT = Path(__file__).parents[3]


def installed(package: Path) -> dict[str, str]:
    """The environment in which a package is installed."""
    place = package.parent / "packages"
    place.mkdir()
    install(package, place)
    return dict(os.environ) | {"PYTHONPATH": os.pathsep.join([str(place), str(ROOT), str(ROOT / "tests/support")])}


def test_the_package_as_it_is_written_gets_right_rows(tmp_path, monkeypatch, capsys):
    """It passes its own test as well: docs/add_a_solver.md runs that."""
    monkeypatch.chdir(tmp_path)
    assert command(["my_rk"]) == 0  # folder and module have one name, and the folder is seen first
    assert "pip install -e my_rk" in capsys.readouterr().out
    folder = tmp_path / "my_rk"
    files = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    assert files == {"pyproject.toml", "README.md", "src/my_rk.py", "tests/test_my_rk.py"}
    case = ROOT / "cases/leaving_slide.yaml"
    options = ["--solvers", "my_rk", "--repeats", "1", "--no-figures", "--tolerances", "1e-6,1e-9", "--timeout", "60"]
    subprocess.run(
        [sys.executable, "-m", "henon_ref.compare", str(case), *options],
        check=True,
        cwd=tmp_path,
        env=installed(folder),
    )
    with (tmp_path / "out/leaving_slide/runs.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["solver"], row["status"], row["verdict"], row["landing"]) for row in rows] == [
        ("my_rk", "ok", "right", "bisection")
    ] * 2
    assert rows[0]["library_version"] == "0.1.0"


def test_the_module_is_short_and_has_one_method_to_fill_in():
    text = new_solver.package_files("my-rk")["src/my_rk.py"]
    code = [line for line in text.splitlines() if line.strip()]
    assert len(code) <= 60
    assert text.count("def integrate(self, t, x, until):") == 1
    assert 'ModeSolver("my-rk", ' in text


@pytest.mark.parametrize(
    "name", ["", "My-RK", "-rk", "rk-", "a--b", "../up", "a/b", "a b", "1st", "é", "a" * 41, "x\n"]
)
def test_a_bad_name_is_refused_in_one_line_that_says_what_is_allowed(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert command(["--", name]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "lowercase letters and digits" in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("heyoka", "a solver named 'heyoka' is installed"),
        ("lambda", "a keyword or a standard module of Python"),
        ("json", "a keyword or a standard module of Python"),
        ("test", "a keyword or a standard module of Python"),
        ("numpy", "an installed package has a module 'numpy'"),
        ("henon-ref", "an installed package has a module 'henon_ref'"),
    ],
)
def test_a_name_that_is_taken_is_refused(name, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert command([name]) == 2
    assert words in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["folder", "file", "dangling link"])
def test_what_is_there_already_is_left_alone(kind, tmp_path, capsys):
    place = tmp_path / "there"
    if kind == "folder":
        place.mkdir()
    elif kind == "file":
        place.write_text("mine")
    else:
        place.symlink_to(tmp_path / "nowhere")
    assert command(["my-rk", "--out", str(place)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "exists already" in said
    assert [path.name for path in tmp_path.iterdir()] == ["there"]
    assert kind != "file" or place.read_text() == "mine"


def test_out_is_the_folder_that_is_written(tmp_path):
    assert command(["my-rk", "--out", str(tmp_path / "elsewhere")]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["elsewhere"]
    assert (tmp_path / "elsewhere/src/my_rk.py").is_file()
    assert (tmp_path / "elsewhere").stat().st_mode & 0o777 == (tmp_path / "elsewhere/tests").stat().st_mode & 0o777


def test_a_folder_that_cannot_be_written_is_one_message_and_leaves_nothing(tmp_path, monkeypatch, capsys):
    assert command(["my-rk", "--out", str(tmp_path / "no" / "such")]) == 2
    assert "No such file or directory" in capsys.readouterr().err

    def full(path: Path, *rest: object, **options: object) -> None:
        if path.name == "README.md":
            raise OSError(28, "No space left on device")
        path.touch()

    monkeypatch.setattr(Path, "write_text", full)
    assert command(["my-rk", "--out", str(tmp_path / "my-rk")]) == 2
    assert "No space left on device" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_program_in_another_language_is_named_on_the_command_line(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    program = tmp_path / "program.py"
    program.write_text(
        "import json, sys\n"
        "request = json.load(sys.stdin)\n"
        "until = request['problem']['until']\n"
        "times = [1e-3] * request['timed']\n"
        "end = {'time': until, 'state': [until - 1], 'mode': 1}\n"
        "events = [{'time': 1.0, 'before': -1, 'after': 1, 'state': [0.0]}]\n"
        "found = {'protocol': 1, 'program': {'name': 'p', 'version': '2'}, 'status': 'ok'}\n"
        "print(json.dumps(found | {'transitions': events, 'end': end, 'wall_s': times}))\n"
    )
    assert command(["my-program", "--program", f"{sys.executable} program.py"]) == 0
    folder = tmp_path / "my-program"
    assert f"COMMAND = ('{sys.executable}', '{program}')" in (folder / "src/my_program.py").read_text()
    assert "names its program" in (folder / "README.md").read_text()
    (tmp_path / "ramp.yaml").write_text(RAMP)
    options = ["--solvers", "my-program", "--require", "my-program", "--repeats", "2", "--no-figures"]
    subprocess.run(
        [sys.executable, "-m", "henon_ref.compare", "ramp.yaml", *options],
        check=True,
        cwd=tmp_path,
        env=installed(folder),
    )
    with (tmp_path / "out/ramp/runs.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert (row["status"], row["verdict"], float(row["wall_s"]), row["timed_runs"]) == ("ok", "right", 1e-3, "2")


@pytest.mark.parametrize(("words", "said"), [("", "--program is empty"), ("a 'b", "No closing quotation")])
def test_a_command_line_that_is_none_is_refused(tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    assert command(["my-program", "--program", words]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "my-program").exists()
