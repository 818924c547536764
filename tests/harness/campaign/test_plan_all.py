"""``--solvers all``: the default solvers of each reading, and the peers."""

from __future__ import annotations

import pytest

import henon_ref
from henon_ref.errors import CaseError
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Options, check_solvers, chosen_solvers


def test_all_is_what_a_reading_lists_or_else_the_default_ones_and_the_peers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "library_version", lambda name: "1.0" if name.startswith("diffsol") else "")
    case = henon_ref.load_case("fig8")
    listing, limit = (case.reading(name) for name in ("listing", "listing_limit"))
    every = Options(solvers=("all",))
    assert [*chosen_solvers(listing, every)] == [*chosen_solvers(listing, Options())] == ["henon-listing"]
    assert set(chosen_solvers(limit, every)) == {*chosen_solvers(limit, Options()), "diffsol-tsit45", "diffsol-bdf"}
    assert "henon-newton" in chosen_solvers(limit, Options(solvers=("all", "henon-newton")))
    check_solvers([case], every)
    with pytest.raises(CaseError, match="unknown solver 'al'"):
        check_solvers([case], Options(solvers=("al",)))
