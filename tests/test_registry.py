"""Solvers by name: built-in ones without importing them, third parties' by entry point."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import EntryPoint

import pytest

from henon_ref import registry
from henon_ref.errors import CaseError, UnavailableError


class ThirdParty:
    name = "third-party"
    fixed_step = True
    landing = "theirs"
    version = "9.9"

    def prepare(self, problem, **options):
        raise NotImplementedError


def make() -> ThirdParty:
    return ThirdParty()


READY = ThirdParty()


@pytest.fixture
def entry_point(monkeypatch):
    def register(name: str, value: str) -> None:
        point = EntryPoint(name=name, value=value, group=registry.GROUP)
        monkeypatch.setattr(registry, "_third_party", lambda: {name: point})

    return register


@pytest.mark.parametrize("name", ["henon", "henon-rk4", "henon-listing", "henon-newton", "henon-brent"])
def test_every_own_solver_is_found_under_its_name(name):
    found = registry.solver(name)
    assert found.name == name
    assert found.fixed_step == registry.fixed_step(name)


@pytest.mark.parametrize("name", registry.names())
def test_every_built_in_solver_is_there_where_its_library_is(name):
    library = registry.library_version(name)
    if not library:
        with pytest.raises(UnavailableError, match=name):
            registry.solver(name)
        return
    found = registry.solver(name)
    assert (found.name, found.fixed_step) == (name, registry.fixed_step(name))
    assert found.version


def test_the_listing_and_other_landings_run_only_where_they_are_named():
    assert not {"henon-listing", "henon-newton", "henon-brent"} & set(registry.default_names())
    assert "henon" in registry.default_names()


@pytest.mark.parametrize("attribute", ["READY", "make"])
def test_a_third_party_s_instance_or_factory_is_found(entry_point, attribute):
    entry_point("third-party", f"test_registry:{attribute}")
    assert "third-party" in registry.default_names()
    assert registry.solver("third-party").name == "third-party"
    assert registry.fixed_step("third-party")
    assert registry.library_version("third-party") == ""


def test_a_third_party_that_cannot_be_imported_is_unavailable(entry_point):
    entry_point("third-party", "no_such_module:SOLVER")
    with pytest.raises(UnavailableError, match="no_such_module"):
        registry.solver("third-party")


def test_an_unknown_name_is_refused_with_the_nearest():
    with pytest.raises(CaseError, match="did you mean 'heyoka'"):
        registry.solver("heyokka")


def test_names_cost_no_library():
    code = "import sys; from henon_ref import registry; registry.names(); registry.library_version('scipy-rk45');"
    code += "assert not {'scipy', 'heyoka', 'numba', 'sksundae', 'matplotlib', 'pandas'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
