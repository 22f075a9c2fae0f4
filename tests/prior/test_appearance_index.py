import shutil
from pathlib import Path

import numpy as np
import pytest

from brrp_cli.prior.appearance_index import first_look
from brrp_cli.prior.store import Prior, open_prior


def first_file(folder: Path) -> Path:
    (path,) = folder.glob("appearance-*.npz")
    return path


def all_rows(prior: Prior) -> np.ndarray:
    return prior.appearance.rows(np.arange(len(prior.names)))


def test_a_first_look_is_the_mean_over_views(pristine: Path) -> None:
    prior = open_prior(pristine)
    rows = all_rows(prior)
    first = prior.appearance.first
    np.testing.assert_array_equal(first.sizes, rows["sizes"])
    mean = rows["pairs"].mean(axis=1)
    expected = 255 * mean / np.linalg.norm(mean, axis=1, keepdims=True)
    np.testing.assert_allclose(first.pairs, expected, atol=0.51)
    # Meshes without colours have none in the first look either.
    assert not rows["colour"].any() and not first.colour.any()


def test_rows_come_in_the_order_asked_for(pristine: Path) -> None:
    prior = open_prior(pristine)
    found = prior.appearance.rows(np.array([2, 0]))
    assert found.tobytes() == all_rows(prior)[[2, 0]].tobytes()
    assert len(prior.appearance.rows(np.array([], dtype=np.int64))) == 0


@pytest.mark.parametrize("harm", ["missing", "cut", "changed", "other"])
def test_a_first_look_that_cannot_be_used_is_made_again(prior_folder: Path, harm: str) -> None:
    path = first_file(prior_folder)
    whole = path.read_bytes()
    arrays = dict(np.load(path))
    path.unlink()
    if harm == "cut":
        path.write_bytes(whole[: len(whole) // 2])
    elif harm == "changed":
        start = whole.index(arrays["pairs"].tobytes())
        path.write_bytes(whole[:start] + bytes([whole[start] ^ 1]) + whole[start + 1 :])
    elif harm == "other":
        np.savez(path, **arrays | {"appearance": np.array("0" * 64)})
    prior = open_prior(prior_folder)
    expected = first_look(all_rows(prior))
    for name, value in vars(prior.appearance.first).items():
        np.testing.assert_array_equal(value, getattr(expected, name))
    assert path.read_bytes() == whole


def test_a_lookup_reads_no_shard(prior_folder: Path) -> None:
    shutil.rmtree(prior_folder / "shards")
    assert len(all_rows(open_prior(prior_folder))) == 3
