import numpy as np
import pytest

from brrp_cli.seeds import child_rng, child_seed


def test_a_child_is_the_same_on_every_machine_and_in_every_version() -> None:
    # First four bytes of sha256("0/ransac/7"), little endian, halved.
    assert child_seed(0, "ransac", 7) == 0x3F27D274


def test_children_of_other_seeds_and_names_differ() -> None:
    seeds = [
        child_seed(0),
        child_seed(1),
        child_seed(0, "a"),
        child_seed(0, "a", 1),
        child_seed(0, 1, "a"),
        child_seed(1, "a"),
    ]
    assert len(set(seeds)) == len(seeds)


@pytest.mark.parametrize("seed", [0, -5, 2**40])
def test_children_fit_what_open3d_accepts(seed: int) -> None:
    children = [child_seed(seed, name) for name in range(2000)]
    assert min(children) >= 0
    assert max(children) < 2**31
    # Over 2,000 draws a fair 31-bit seed comes close to both ends.
    assert min(children) < 2**31 * 0.01
    assert max(children) > 2**31 * 0.99


def test_generators_do_not_hang_on_the_order_of_calls() -> None:
    first = child_rng(3, "a").normal(size=4)
    child_rng(3, "b").normal(size=100)
    assert np.array_equal(first, child_rng(3, "a").normal(size=4))
    assert not np.array_equal(first, child_rng(3, "b").normal(size=4))
