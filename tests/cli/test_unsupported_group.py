"""A scene that no solver does: every row of the report says ``unsupported``, and why."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from henon_ref.cli import compare

SCENE = """\
schema: 1
name: many_contacts
title: A block that rubs on more belts than are tried at once
scene:
  bodies:
    m: {{mass: 1}}
    wall: fixed
{belts}
  connections:
    - spring: {{between: [m, wall], stiffness: 1}}
{contacts}
initial: {{x_m: 1, v_m: 0.95}}
until: 5
tolerances: [1e-6]
"""


def test_a_group_of_more_than_eight_contacts_is_unsupported_in_every_row(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    belts = "\n".join(f"    belt{i}: {{velocity: 0.{i}}}" for i in range(1, 10))
    contact = "    - friction: {{between: [m, belt{}], law: coulomb, force: 0.1, static: 0.2}}"
    contacts = "\n".join(contact.format(i) for i in range(1, 10))
    Path("many.yaml").write_text(SCENE.format(belts=belts, contacts=contacts))
    solvers = "henon,scipy-dop853"
    assert compare.command(["many.yaml", "--solvers", solvers, "--repeats", "1", "--no-figures", "--out", "out"]) == 0
    with (tmp_path / "out" / "many_contacts" / "runs.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["solver"] for row in rows] == solvers.split(",")
    assert {row["status"] for row in rows} == {"unsupported"}
    report = (tmp_path / "out" / "many_contacts" / "report.md").read_text()
    assert "a group of 9 contacts that act on each other at once" in report
