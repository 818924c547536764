"""Arguments, names and objects that a comparison rejects before anything runs."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pytest
from fakes import Fake, case

from henon_ref.errors import CaseError, HenonRefError
from henon_ref.harness.campaign.campaign import compare
from henon_ref.harness.campaign.options import Options


def test_an_unknown_argument_is_refused_with_the_nearest_name():
    with pytest.raises(HenonRefError, match="compare has no argument 'solver'; did you mean 'solvers'"):
        compare(case(), solver=["henon"])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"processes": 0}, "processes is a whole number from 1 on, not 0"),
        ({"processes": 1.5}, "processes is a whole number from 1 on, not 1.5"),
        ({"repeats": 0}, "repeats is a whole number from 1 to 10000, not 0"),
        ({"repeats": 10**9}, "repeats is a whole number from 1 to 10000, not 1000000000"),
        ({"repeats": True}, "repeats is a whole number from 1 to 10000, not True"),
        ({"timeout": -1}, "timeout is a number of seconds from 0.01 to 1e+06, not -1"),
        ({"timeout": math.inf}, "timeout is a number of seconds from 0.01 to 1e+06, not inf"),
        ({"timeout": math.nan}, "timeout is a number of seconds from 0.01 to 1e+06, not nan"),
        ({"tolerances": [1e-6, 0]}, "a tolerance lies between 1e-16 and 1, not 0"),
        ({"tolerances": [1.0]}, "a tolerance lies between 1e-16 and 1, not 1.0"),
        ({"tolerances": [math.nan]}, "a tolerance lies between 1e-16 and 1, not nan"),
        ({"tolerances": ["1e-6"]}, "a tolerance lies between 1e-16 and 1, not '1e-6'"),
        ({"tolerances": []}, "tolerances is empty; None stands for the tolerances of the case"),
        ({"tolerances": 1e-6}, "tolerances is 1e-06, wanted a sequence: tolerances=[1e-06]"),
        ({"solvers": "henon"}, "solvers is 'henon', wanted a sequence: solvers=['henon']"),
        ({"solvers": []}, "solvers is empty; None stands for the solvers of the case"),
        ({"solvers": [42]}, "solvers: 42 is no solver: int has no name, fixed_step, landing, prepare"),
        ({"solvers": [Fake]}, "is the class Fake, wanted an instance of it: Fake()"),
        ({"solvers": [Fake(), Fake(what="misses")]}, "more than one is named 'fake'"),
    ],
)
def test_an_argument_that_is_not_allowed_is_refused_before_anything_runs(options, words):
    with pytest.raises(CaseError) as refused:
        compare(case(), **options)
    assert words in str(refused.value)


def test_the_bounds_of_the_options_are_allowed_themselves():
    options = Options(tolerances=(1e-16, 0.999), repeats=1, timeout=0.01, processes=1)
    assert (options.tolerances, options.timeout) == ((1e-16, 0.999), 0.01)


def test_a_path_in_place_of_a_case_is_refused_with_how_to_read_it():
    with pytest.raises(CaseError, match=r"case is 'my_belt\.yaml', wanted a Case"):
        compare("my_belt.yaml")


@dataclass(frozen=True)
class Stateless(Fake):
    """Goes into no pickle, by an error of its own."""

    def __getstate__(self):
        raise RuntimeError("it holds a device")


@dataclass(frozen=True)
class Undecided:
    """Cannot say whether it has a fixed step."""

    name: str = "undecided"
    landing: str = "none"

    @property
    def fixed_step(self):
        raise RuntimeError("not connected")

    def prepare(self, problem, **settings):
        raise NotImplementedError


def test_a_solver_that_raises_on_the_way_to_a_worker_is_named():
    with pytest.raises(HenonRefError, match=r"cannot be sent to its worker \(RuntimeError: it holds a device\)"):
        compare(case(), solvers=[Stateless()])


def test_a_solver_whose_attributes_raise_is_refused():
    with pytest.raises(CaseError, match="is no solver: its fixed_step raises RuntimeError: not connected"):
        compare(case(), solvers=[Undecided()])


def test_a_solver_that_cannot_be_sent_to_a_worker_is_named():
    class Local(Fake):
        pass

    with pytest.raises(HenonRefError, match="top of a module"):
        compare(case(), solvers=[Local()])
