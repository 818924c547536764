"""Fixtures that several files of tests share."""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Generator
from importlib.util import find_spec
from pathlib import Path
from uuid import uuid4

import hypothesis
import matplotlib
import pytest
from commands import SOLVERS, drawing
from fakes import CASE, truth
from often import EVERY_PYTHON

from henon_ref.errors import UnavailableError
from henon_ref.harness import registry
from henon_ref.harness.cli import compare_cases
from henon_ref.harness.truth import compute, store
from henon_ref.jit.cache_folder import VARIABLE, cache_root
from henon_ref.workers import pool, worker_process
from henon_ref.workers.worker import collect_seldom

LIBRARIES = {"heyoka": "heyoka", "scikit-sundae": "sksundae"}
"""Packages that a machine may be without, and their modules."""
ABSENT = [f"{package} is not installed" for package, module in LIBRARIES.items() if find_spec(module) is None]
"""What is said then by their solvers, and below by what needs the extra ``sweep``."""
if find_spec("pyarrow") is None:
    ABSENT.append("needs pyarrow, which is not installed")
# No example has a time limit, since the machine may do other things. The same ones are drawn every day; .ci/slow draws
# others, by --hypothesis-profile=drawn.
hypothesis.settings.register_profile("drawn", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow])
hypothesis.settings.register_profile("daily", hypothesis.settings.get_profile("drawn"), derandomize=True, database=None)
hypothesis.settings.load_profile("daily")
sys.dont_write_bytecode = False  # whatever the environment says: hundreds of processes that tests begin would compile
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # all that they import, each anew
os.environ[VARIABLE] = str(cache_root())  # for processes that tests begin with another cache of truths, too
os.environ.setdefault("MPLCONFIGDIR", matplotlib.get_cachedir())  # so that they need not look for fonts
collect_seldom()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what one Python is enough for."""
    here = Path(__file__).parent
    for item in items:
        if not item.path.relative_to(here).as_posix().startswith(EVERY_PYTHON):
            item.add_marker("long")


def pytest_collection_finish() -> None:
    """Spare looking for garbage among the thousands of tests and all that is imported, a tenth of all time."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call() -> Generator[None, object, object]:
    """Skip a test that calls what is not installed here; one that expects just that to be said is run."""
    try:
        return (yield)
    except (UnavailableError, AssertionError) as error:
        cause: BaseException | None = error
        while cause is not None and not isinstance(cause, UnavailableError):
            cause = cause.__context__
        if any(words in str(cause) for words in ABSENT):
            pytest.skip(str(cause))
        raise


@pytest.fixture(autouse=True)
def _own_truths(monkeypatch, tmp_path_factory):
    """Truths that a test computes are found by no other test, nor by the user."""
    folder = tmp_path_factory.getbasetemp() / "truths" / uuid4().hex
    monkeypatch.setattr(store, "user_folder", lambda: folder)


@pytest.fixture
def made_up_solvers(monkeypatch, tmp_path):
    """In place of real ones in the command, whose folder is a temporary one."""
    monkeypatch.setattr(compare_cases, "figure_job", lambda result, records: drawing(result.reading.name))
    monkeypatch.setattr(compute, "truth_for", truth)
    monkeypatch.setattr(registry, "solver", SOLVERS.__getitem__)
    for module in worker_process, pool:  # workers have them by fork alone, which threads of earlier tests would prevent
        monkeypatch.setattr(module, "start_method", lambda: "fork")
    monkeypatch.chdir(tmp_path)
    handler = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, handler)


@pytest.fixture
def made_up(tmp_path) -> Path:
    """A case file for them."""
    path = tmp_path / "made_up.yaml"
    path.write_text(CASE.format(name="made_up"))
    return path
