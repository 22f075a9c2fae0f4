"""True meshes are kept on disk; a damaged file is told with its way out."""

from pathlib import Path

import numpy as np
import pytest
from for_people import assert_for_people

from brrp_cli.errors import SceneError
from brrp_cli.ground_truth.kept import read_kept
from brrp_cli.ground_truth.true_meshes import exact_truth
from brrp_cli.ground_truth.truth import TrueObject
from brrp_cli.shapes import solids


def test_arrays_come_in_the_order_of_their_names(tmp_path):
    np.savez(tmp_path / "a.npz", one=np.arange(3), two=np.eye(2))
    two, one = read_kept(tmp_path / "a.npz", "two", "one")
    np.testing.assert_array_equal(two, np.eye(2))
    np.testing.assert_array_equal(one, np.arange(3))


def test_an_array_that_is_not_there_is_named(tmp_path):
    np.savez(tmp_path / "a.npz", one=np.arange(3))
    with pytest.raises(SceneError, match=r"one and two(.|\n)*two is not a file"):
        read_kept(tmp_path / "a.npz", "one", "two")


@pytest.mark.parametrize("which", ["*-settled.npz", "*-thickness.npz"])
@pytest.mark.parametrize("part", [0.0, 0.5])
def test_a_damaged_file_is_told_with_its_way_out(which: str, part: float, tmp_path: Path) -> None:
    solids.box(0.1, 0.06, 0.04).export(tmp_path / "box.ply")
    thing = TrueObject(1, "box.ply", np.eye(4))
    cache = tmp_path / "kept"
    first = exact_truth(thing, tmp_path, cache)
    assert exact_truth(thing, tmp_path, cache).thickness == first.thickness
    (kept,) = cache.glob(which)
    whole = kept.read_bytes()
    kept.write_bytes(whole[: int(part * len(whole))])
    with pytest.raises(SceneError, match="remove the file") as caught:
        exact_truth(thing, tmp_path, cache)
    assert str(kept) in str(caught.value)
    assert_for_people(caught.value)
    kept.unlink()
    assert exact_truth(thing, tmp_path, cache).thickness == first.thickness
