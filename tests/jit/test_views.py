"""Views of numbers in memory hold what numba's arrays do."""

from __future__ import annotations

import numpy as np
import pytest

from henon_ref.jit.njit import njit
from henon_ref.jit.views import integers_in, rest_of, row_at, row_of, rows_in, rows_of


@njit()
def read(matrices, i, j, k):  # type: ignore[no-untyped-def]
    rows = rows_in(matrices, i)
    return rows[j, k], rows[j][k], rest_of(rows, j)[0, k], rest_of(rows[j], k)[0]


@njit()
def changed(matrices, i, j, k):  # type: ignore[no-untyped-def]
    rows = rows_in(matrices, i)
    rows[j, k] = 7
    rows[j, k] += 1
    rows[0][0] -= 2


@njit()
def cut(numbers, width):  # type: ignore[no-untyped-def]
    rows = rows_of(row_of(numbers), width)
    return rows[1, 0], rows[1][2], rest_of(rest_of(numbers, 2), 1)[1]


@njit()
def at_address(address, i):  # type: ignore[no-untyped-def]
    return row_at(address)[i]


@njit()
def held(doubles, i):  # type: ignore[no-untyped-def]
    return integers_in(row_of(doubles))[i]


@pytest.mark.parametrize("kind", [np.float64, np.int64])
@pytest.mark.parametrize(("i", "j", "k"), [(0, 0, 0), (1, 2, 3), (1, 0, 3), (0, 2, 1)])
def test_an_entry_is_the_array_s(kind: type, i: int, j: int, k: int) -> None:
    matrices = np.arange(24, dtype=kind).reshape(2, 3, 4)
    assert read(matrices, i, j, k) == (matrices[i, j, k],) * 4


@pytest.mark.parametrize("kind", [np.float64, np.int64])
def test_what_is_set_is_set_in_the_array_and_nowhere_else(kind: type) -> None:
    matrices = np.zeros((2, 3, 4), dtype=kind)
    changed(matrices, 1, 2, 3)
    assert (matrices[1, 2, 3], matrices[1, 0, 0]) == (8, -2)
    assert np.count_nonzero(matrices) == 2


def test_a_row_is_cut_into_rows_and_begun_later() -> None:
    assert cut(np.arange(12.0), 5) == (5.0, 7.0, 4.0)


def test_numbers_are_found_by_their_address_and_by_their_bits() -> None:
    doubles = np.array([1.5, 2.5])
    assert at_address(doubles.ctypes.data, 1) == 2.5
    assert held(np.array([3, 4]).view(np.float64), 1) == 4
