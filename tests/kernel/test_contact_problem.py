"""Contact problems solved in compiled code: the modes of the route in Python, and none where a sign is in doubt."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from henon_ref.kernel.library import doubles, ffi, kernel
from henon_ref.modes.contact_problem import ContactProblem, solved


def compiled(problem: ContactProblem) -> tuple[bool, tuple[int, ...]]:
    """Whether it is clear, and the entries."""
    count = len(problem.free)
    entries = ffi.new("int64_t[]", max(count, 1))
    parts = [np.array(part, dtype=float) for part in problem[:4]]
    clear = kernel.test_clearly_solved(count, *(doubles(part) for part in parts), entries)
    return bool(clear), tuple(entries[k] for k in range(count))


def chain(random: np.random.Generator, count: int) -> ContactProblem:
    """Bodies on each other with masses from 0.01 to 100, and friction of all sizes."""
    mass = 10.0 ** random.uniform(-2, 2, count)
    jacobian = np.eye(count) - np.eye(count, k=-1)
    matrix: NDArray[np.float64] = jacobian @ np.diag(1 / mass) @ jacobian.T
    limits = 10.0 ** random.uniform(-1, 1, count)
    free = jacobian @ (random.normal(size=count) * 3 / mass)
    return ContactProblem(list(free), [list(row) for row in matrix], list(-limits), list(limits))


@pytest.mark.parametrize("count", [1, 2, 3, 5, 8])
def test_modes_are_those_of_python(count: int) -> None:
    random, told = np.random.default_rng(count), 0
    for _ in range(300):
        problem = chain(random, count)
        clear, entries = compiled(problem)
        told += clear
        if clear:
            assert entries == solved(problem).entries
    assert told > 290


@pytest.mark.parametrize("ratio", [1 - 1e-8, 1.0, 1 + 1e-8])
def test_a_load_at_its_limit_is_not_clear(ratio: float) -> None:
    assert not compiled(ContactProblem([2.0 * ratio], [[0.5]], [-4.0], [4.0]))[0]
    assert compiled(ContactProblem([2.0 * 0.999], [[0.5]], [-4.0], [4.0])) == (True, (0,))
    assert compiled(ContactProblem([2.0 * 1.001], [[0.5]], [-4.0], [4.0])) == (True, (1,))


def test_a_doubt_grows_with_how_badly_the_forces_are_settled() -> None:
    """Two contacts that nearly depend on each other: their forces are large differences of small numbers."""
    for gap, clear in ((1e-1, True), (1e-7, False), (1e-12, False)):
        problem = ContactProblem([0.3, 0.3], [[1.0, 1 - gap], [1 - gap, 1.0]], [-1.0, -1.0], [1.0, 1.0])
        assert compiled(problem)[0] == clear


def test_what_is_no_number_is_not_clear() -> None:
    assert not compiled(ContactProblem([np.nan], [[1.0]], [-1.0], [1.0]))[0]
    assert not compiled(ContactProblem([1.0], [[0.0]], [-1.0], [1.0]))[0]
    assert not compiled(ContactProblem([1.0, 1.0], [[1.0, np.inf], [np.inf, 1.0]], [-1.0] * 2, [1.0] * 2))[0]


def test_no_contact_is_settled_at_once() -> None:
    assert compiled(ContactProblem([], [], [], []))[0]
