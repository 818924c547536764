"""Cases that come with the package are found by name, from anywhere; a path wins where there is one."""

from __future__ import annotations

from pathlib import Path

import pytest

import henon_ref
from henon_ref.casefile import files
from henon_ref.casefile.files import case_files, located, shipped_folder, shipped_names
from henon_ref.errors import CaseError
from henon_ref.harness.campaign.options import load_cases
from henon_ref.harness.truth import store

CASES = Path(__file__).parents[2] / "cases"
FIG8 = CASES / "fig8.yaml"


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to be called in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", ["fig8", "grazing", "hard/grazing", "classic/twisting"])
def test_a_name_is_that_of_a_case(name: str) -> None:
    case = henon_ref.load_case(name)
    assert case.name == name.split("/")[-1]
    assert case.path is not None
    assert case.path.is_relative_to(shipped_folder())


def test_a_name_of_a_folder_stands_for_its_cases() -> None:
    assert [f.name for f in case_files(Path("classic"))] == sorted(f.name for f in (CASES / "classic").glob("*.yaml"))
    everything = {f.stem for f in CASES.rglob("*.yaml")}
    assert {f.stem for f in case_files(Path("cases"))} == everything


def test_every_case_and_folder_has_its_name() -> None:
    files = set(CASES.rglob("*.yaml"))
    folders = {CASES, CASES / "classic", CASES / "hard", CASES / "scenes"}
    assert {p.resolve() for p in shipped_names().values()} == files | folders
    assert len({f.stem for f in files}) == len(files)
    assert "truth" not in shipped_names()


def test_a_path_wins_over_a_name(elsewhere: Path) -> None:
    mine = elsewhere / "fig8"
    mine.write_text(FIG8.read_text().replace("name: fig8", "name: mine"))
    (elsewhere / "hard").mkdir()
    (elsewhere / "hard" / "grazing.yaml").write_text(mine.read_text())
    assert henon_ref.load_case("fig8").name == "mine"
    assert case_files(Path("hard")) == [Path("hard/grazing.yaml")]
    assert henon_ref.load_case("hard/grazing_sliding").name == "grazing_sliding"


def test_a_path_is_as_before(elsewhere: Path) -> None:
    assert located(FIG8) == FIG8
    with pytest.raises(CaseError, match=r"nowhere\.yaml: there is no such file"):
        henon_ref.load_case("nowhere.yaml")
    with pytest.raises(CaseError, match="there is no such file"):
        henon_ref.load_case(elsewhere / "fig8")  # an absolute path is no name


def test_a_case_named_twice_is_read_once() -> None:
    assert [case.name for case in load_cases([Path("fig8"), FIG8])] == ["fig8"]


@pytest.mark.parametrize(
    ("name", "similar"), [("fig9", "fig8"), ("hard/grazin", "hard/grazing"), ("Classic", "classic")]
)
def test_an_unknown_name_is_told_with_similar_ones(name: str, similar: str) -> None:
    with pytest.raises(CaseError, match=f"^{name}: no file, folder or shipped case has this name.*: .*{similar}"):
        load_cases([Path(name)])


def test_a_name_like_none_is_told_where_the_names_are() -> None:
    with pytest.raises(CaseError, match="henon-ref cases lists"):
        henon_ref.load_case("0000000")


def test_stored_truths_are_those_beside_the_shipped_cases() -> None:
    case = henon_ref.load_case("hard/two_contacts")
    assert store.folder_of(case.path) == shipped_folder() / "truth"
    assert store.load(store.folder_of(case.path), case.name, case.readings[0].name) is not None


def test_a_wheel_has_them_inside_the_package(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = elsewhere / "site-packages" / "henon_ref"
    (package / "cases").mkdir(parents=True)
    (package / "cases" / "only.yaml").write_text("")
    monkeypatch.setattr(files, "_PACKAGE", package)
    shipped_names.cache_clear()
    try:
        assert set(shipped_names()) == {"cases", "only"}
        assert located("only") == package / "cases" / "only.yaml"
    finally:
        shipped_names.cache_clear()
