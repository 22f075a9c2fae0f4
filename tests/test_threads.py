"""Items in threads: their order, their errors, and the same bytes on any number of them."""

from __future__ import annotations

import sys
import threading

import numpy as np
import pytest
import torch

from brrp_cli.threads import in_threads


@pytest.mark.parametrize("workers", [1, 3])
def test_results_come_in_the_order_of_the_items(workers):
    assert list(in_threads(lambda x: x * x, range(20), workers)) == [x * x for x in range(20)]


def test_items_run_beside_each_other():
    meet = threading.Barrier(2, timeout=30)
    assert sorted(in_threads(lambda _: meet.wait(), [0, 1], 2)) == [0, 1]


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_ends_it(workers):
    def fail(x):
        if x == 1:
            raise ValueError("one")
        return x

    with pytest.raises(ValueError, match="one"):
        list(in_threads(fail, range(4), workers))


def test_libraries_have_one_thread_meanwhile_and_theirs_again_afterwards():
    before = torch.get_num_threads()
    assert list(in_threads(lambda _: torch.get_num_threads(), range(4), 2)) == [1] * 4
    assert torch.get_num_threads() == before


def test_sums_have_the_same_bytes_on_any_number_of_threads():
    values = np.random.default_rng(0).standard_normal((4, 300, 300)).astype(np.float32)

    def product(x):
        return (torch.from_numpy(x) @ torch.from_numpy(x)).numpy().tobytes()

    found = [list(in_threads(product, list(values), workers)) for workers in (1, 2, 4)]
    assert found[0] == found[1] == found[2]


def test_turns_are_short_meanwhile_and_as_before_afterwards():
    before = sys.getswitchinterval()
    assert (
        list(in_threads(lambda _: sys.getswitchinterval() < 1e-3 < before, range(4), 2))
        == [True] * 4
    )
    assert sys.getswitchinterval() == before
