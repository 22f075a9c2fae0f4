import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from brrp_cli.config import preset
from brrp_cli.errors import PriorError, RetrievalError
from brrp_cli.files import sha256_file
from brrp_cli.prior.manifest import FILE
from brrp_cli.prior.shard import object_names, open_shard, read_stored, write_shard
from brrp_cli.prior.store import open_prior, verify_prior
from brrp_cli.retrieval.choose import choose_retriever, resolve_name


def sidecar(folder: Path) -> Path:
    (path,) = folder.glob("appearance-*.npy")
    return path


def test_a_row_is_what_the_shard_holds(pristine: Path) -> None:
    prior = open_prior(pristine)
    assert prior.appearance is not None and len(prior.appearance) == len(prior.names)
    rows = prior.appearance.rows(np.arange(len(prior.names)))
    for name, row in zip(prior.names, rows, strict=True):
        stored = prior.load(name).appearance
        assert stored is not None
        np.testing.assert_array_equal(row["colour"], stored.colour)
        np.testing.assert_array_equal(row["pairs"], stored.pairs)
        count = len(stored.sizes)
        np.testing.assert_array_equal(row["sizes"][:count], stored.sizes)
        assert np.isnan(row["sizes"][count:]).all()


def test_sizes_are_those_of_the_resting_poses(pristine: Path) -> None:
    box = open_prior(pristine).load("red_box").appearance
    assert box is not None
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
    assert prior.appearance is not None
    # What has its size is checked where it is read.
    row = prior.appearance.rows(np.array([2]))
    assert row.tobytes() == before[-row.nbytes :]
    assert sidecar(prior_folder).read_bytes() == before
    assert verify_prior(open_prior(prior_folder)) == []


def make_old(folder: Path) -> None:
    """As a brrp without appearance wrote it; its manifest's checks of bytes are brought in line."""
    sidecar(folder).unlink()
    table = json.loads((folder / FILE).read_text())
    del table["appearance"], table["parameters"]["appearance"], table["content_sha256"]
    table["schema"] = 1
    for shard in table["shards"]:
        path = folder / shard["file"]
        with open_shard(path) as file:
            stored = [read_stored(file, name) for name in object_names(file)]
        for item in stored:
            for key in [k for k in item.arrays if k.startswith("appearance/")]:
                del item.arrays[key]
        write_shard(path, stored, table["parameters"])
        with h5py.File(path, "r+") as file:
            file.attrs["schema"] = 1
        shard |= {"sha256": sha256_file(path), "bytes": path.stat().st_size}
    (folder / FILE).write_text(json.dumps(table))


def test_an_older_prior_is_still_read(prior_folder: Path) -> None:
    make_old(prior_folder)
    prior = open_prior(prior_folder)
    assert verify_prior(prior) == []
    assert prior.appearance is None and prior.load("red_box").appearance is None
    again = json.loads(prior.manifest.as_bytes())
    assert len(again.pop("content_sha256")) == 64
    assert again == json.loads((prior_folder / FILE).read_text()) | {
        "libraries": prior.manifest.libraries
    }
    assert resolve_name("auto", None, prior) == "fitness"
    with pytest.raises(RetrievalError, match="does not know what its objects look like") as caught:
        choose_retriever("appearance", prior, preset("default"), 0)
    assert "--overwrite" in str(caught.value)


def test_auto_is_appearance_where_the_prior_knows_it(pristine: Path) -> None:
    assert resolve_name("auto", None, open_prior(pristine)) == "appearance"


def test_taking_descriptors_out_of_a_shard_is_noticed(prior_folder: Path) -> None:
    prior = open_prior(prior_folder)
    path = prior_folder / prior.entries["red_box"].shard
    with h5py.File(path, "r+") as file:
        del file["objects/red_box/appearance"]
    with open_shard(path) as file, pytest.raises(PriorError, match="damaged") as caught:
        read_stored(file, "red_box")
    assert "checksum" in str(caught.value)
