from pathlib import Path

import h5py
import numpy as np
import pytest

from brrp_cli.errors import PriorError
from brrp_cli.prior.shard import open_shard, read_stored
from brrp_cli.prior.store import open_prior, verify_prior


def sidecar(folder: Path) -> Path:
    (path,) = folder.glob("appearance-*.npy")
    return path


def test_a_row_is_what_the_shard_holds(pristine: Path) -> None:
    prior = open_prior(pristine)
    assert len(prior.appearance) == len(prior.names)
    rows = prior.appearance.rows(np.arange(len(prior.names)))
    for name, row in zip(prior.names, rows, strict=True):
        stored = prior.load(name).appearance
        np.testing.assert_array_equal(row["colour"], stored.colour)
        np.testing.assert_array_equal(row["pairs"], stored.pairs)
        count = len(stored.sizes)
        np.testing.assert_array_equal(row["sizes"][:count], stored.sizes)
        assert np.isnan(row["sizes"][count:]).all()


def test_sizes_are_those_of_the_resting_poses(pristine: Path) -> None:
    box = open_prior(pristine).load("red_box").appearance
    for height in (0.04, 0.06, 0.10):
        best = box.sizes[np.abs(box.sizes[:, 0] - height).argmin()]
        np.testing.assert_allclose(np.sort(best), [0.04, 0.06, 0.10], atol=0.001)


@pytest.mark.parametrize("harm", ["missing", "cut", "changed"])
def test_what_is_missing_or_damaged_is_made_again(prior_folder: Path, harm: str) -> None:
    path = sidecar(prior_folder)
    before = path.read_bytes()
    if harm == "missing":
        path.unlink()
    elif harm == "cut":
        path.write_bytes(before[:-10])
    else:
        path.write_bytes(before[:-1] + bytes([before[-1] ^ 1]))
    prior = open_prior(prior_folder)
    assert [line for line in verify_prior(prior) if "appearance" in line]
    # What has its size is checked where it is read.
    row = prior.appearance.rows(np.array([2]))
    assert row.tobytes() == before[-row.nbytes :]
    assert sidecar(prior_folder).read_bytes() == before
    assert verify_prior(open_prior(prior_folder)) == []


def test_taking_descriptors_out_of_a_shard_is_noticed(prior_folder: Path) -> None:
    prior = open_prior(prior_folder)
    path = prior_folder / prior.entries["red_box"].shard
    with h5py.File(path, "r+") as file:
        del file["objects/red_box/appearance"]
    with open_shard(path) as file, pytest.raises(PriorError, match="no data set appearance/colour"):
        read_stored(file, "red_box")
