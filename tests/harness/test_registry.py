"""Solvers by name: built-in ones without importing them, those of other packages by entry point."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from importlib.metadata import EntryPoint

import pytest
import systems

from henon_ref.errors import CaseError, UnavailableError
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import fixed_step


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
NUMBER = 5


def refuse() -> ThirdParty:
    raise RuntimeError("no licence\nfound")


def leave() -> ThirdParty:
    sys.exit(3)


def lack() -> ThirdParty:
    raise UnavailableError("their library is not installed")


def hang() -> ThirdParty:
    time.sleep(60)
    return READY


def die() -> ThirdParty:
    os.abort()


class Halfway:
    name = "halfway"
    fixed_step = True


class Worded(ThirdParty):
    fixed_step = "no"


HALFWAY, WORDED = Halfway(), Worded()


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
    assert found.fixed_step == fixed_step(name)


@pytest.mark.parametrize("name", registry.names())
def test_every_built_in_solver_is_there_where_its_library_is(name):
    library = registry.library_version(name)
    if not library:
        line = r"(: pip install 'henon-ref\[peers\]')?"
        with pytest.raises(UnavailableError, match=f"^{registry.distribution(name)} is not installed{line}$"):
            registry.solver(name).prepare(systems.leaving_slide(), rtol=1e-6)
        return
    found = registry.solver(name)
    assert (found.name, found.fixed_step) == (name, fixed_step(name))
    assert found.version


def test_the_listing_and_other_landings_run_only_where_they_are_named():
    assert not {"henon-listing", "henon-newton", "henon-brent"} & set(registry.default_names())
    assert "henon" in registry.default_names()


def test_all_stands_for_the_default_and_the_peers_that_are_installed(monkeypatch):
    monkeypatch.setattr(registry, "library_version", lambda name: "1" if name.startswith("diffsol") else "")
    assert registry.expanded(["all"]) == (*registry.default_names(), "diffsol-tsit45", "diffsol-bdf")
    assert registry.expanded(["nosnoc", "henon", "nosnoc"]) == ("nosnoc", "henon")


def test_no_peer_runs_by_default_and_none_is_imported_with_its_adapter():
    peers = ["diffrax-dopri8", "diffrax-kvaerno5", "nosnoc", "diffsol-tsit45", "diffsol-bdf"]
    assert set(peers) <= set(registry.names()) - set(registry.default_names())
    lines = ["import sys", "from henon_ref.harness import registry", "import henon_ref.harness.cli.compare"]
    lines += [f"registry.solver({name!r})" for name in peers]
    lines += ["print(sorted({'jax', 'diffrax', 'nosnoc', 'casadi', 'pydiffsol'} & set(sys.modules)))"]
    done = subprocess.run([sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize("attribute", ["READY", "make"])
def test_a_third_party_s_instance_or_factory_is_found(entry_point, attribute):
    entry_point("third-party", f"test_registry:{attribute}")
    assert "third-party" in registry.default_names()
    assert registry.solver("third-party").name == "third-party"
    assert fixed_step("third-party")
    assert registry.library_version("third-party") == ""


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("no_such_module:SOLVER", "cannot be loaded: ModuleNotFoundError: No module named 'no_such_module'"),
        ("test_registry:NOPE", "cannot be loaded: AttributeError: module 'test_registry' has no attribute 'NOPE'"),
        ("test_registry:NUMBER", "is no solver: int has no name, fixed_step, landing, prepare"),
        ("test_registry:ThirdParty", "is the class ThirdParty, wanted an instance of it: ThirdParty()"),
        ("test_registry:HALFWAY", "is no solver: Halfway has no landing, prepare"),
        ("test_registry:WORDED", "is no solver: its fixed_step is 'no', wanted a bool"),
        ("test_registry:refuse", "cannot be loaded: RuntimeError: no licence found"),
        ("test_registry:leave", "cannot be loaded: SystemExit: 3"),
    ],
)
def test_an_entry_point_without_a_solver_is_unavailable_and_says_what_it_holds(entry_point, value, words):
    entry_point("third-party", value)
    with pytest.raises(UnavailableError) as refused:
        registry.solver("third-party")
    assert str(refused.value).startswith(f"the entry point third-party = {value} {words}")


def test_what_is_asked_of_a_solver_before_it_runs_fails_for_no_entry_point(entry_point):
    entry_point("third-party", "no_such_module:SOLVER")
    assert registry.check("third-party") == "third-party"
    assert "third-party" in registry.default_names()
    assert not fixed_step("third-party")
    assert registry.library_version("third-party") == ""
    assert registry.restart_of("third-party") == ""


@pytest.mark.parametrize(
    ("value", "words"), [("test_registry:hang", "no answer within the time"), ("test_registry:die", "SIGABRT")]
)
def test_an_entry_point_that_hangs_or_dies_takes_nobody_with_it(entry_point, monkeypatch, value, words):
    monkeypatch.setattr("henon_ref.harness.campaign.options.LOADING_SECONDS", 1.0)
    entry_point("third-party", value)
    assert not fixed_step("third-party")
    with pytest.raises(UnavailableError, match=f"the entry point third-party = {value} cannot be loaded: .*{words}"):
        registry.solver("third-party")


def test_a_third_party_may_say_itself_that_its_library_is_missing(entry_point):
    entry_point("third-party", "test_registry:lack")
    with pytest.raises(UnavailableError, match=r"^their library is not installed$"):
        registry.solver("third-party")


def test_a_third_party_s_name_may_hold_an_at(entry_point):
    entry_point("third@party", "test_registry:READY")
    assert registry.base_name("third@party") == registry.check("third@party") == "third@party"
    assert registry.restart_of("third@party") == ""
    assert registry.solver("third@party").name == "third-party"
    assert fixed_step("third@party")


def test_an_unknown_name_is_refused_with_the_nearest():
    with pytest.raises(CaseError, match="did you mean 'heyoka'"):
        registry.solver("heyokka")


def test_names_cost_no_library():
    code = (
        "import sys; from henon_ref.harness import registry; registry.names(); registry.library_version('scipy-rk45');"
    )
    code += "print({'scipy', 'heyoka', 'numba', 'sksundae', 'matplotlib', 'pandas'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "set()"


@pytest.mark.parametrize("restart", registry.RESTARTS)
@pytest.mark.parametrize("name", [name for name in registry.default_names() if registry.restart_of(name)])
def test_every_library_is_restarted_as_its_name_says(name, restart):
    pytest.importorskip({"heyoka": "heyoka", "scikit-sundae": "sksundae"}.get(registry.distribution(name), "scipy"))
    assert registry.solver(name).restart == registry.restart_of(name)
    found = registry.solver(registry.with_restart(name, restart))
    assert (found.name, found.restart) == (f"{name}@{restart}", restart)
    assert not fixed_step(found.name)
    assert registry.library_version(found.name) == registry.library_version(name)


def test_a_solver_without_a_library_to_restart_is_left_as_it_is_and_refuses_a_restart():
    assert registry.with_restart("henon", "offset") == "henon"
    with pytest.raises(CaseError, match="'henon' restarts no library"):
        registry.check("henon@offset")


def test_an_unknown_restart_is_refused_with_the_nearest():
    with pytest.raises(CaseError, match="unknown restart 'ofset'; did you mean 'offset'"):
        registry.solver("heyoka@ofset")


def test_the_restarts_are_those_that_the_adapters_know():
    from typing import get_args

    from henon_ref.baselines.restart import Restart

    assert get_args(Restart) == registry.RESTARTS
