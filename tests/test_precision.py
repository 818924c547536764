"""The precision of python-flint is the process's: who sets it has it alone."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor

from flint import ctx

from henon_ref.precision import working_precision


def seen(bits: int) -> list[int]:
    found = []
    for _ in range(20):
        with working_precision(bits):
            time.sleep(1e-4)
            found.append(ctx.prec)
    return found


def test_threads_that_set_a_precision_each_have_their_own() -> None:
    wanted = [100, 220, 300, 500]
    with ThreadPoolExecutor(len(wanted)) as threads:
        found = list(threads.map(seen, wanted))
    assert found == [[bits] * 20 for bits in wanted]


def test_within_one_precision_another_can_be_set() -> None:
    before = ctx.prec
    with working_precision(200):
        with working_precision(300):
            assert ctx.prec == 300
        assert ctx.prec == 200
    assert ctx.prec == before
