"""Arrays of all objects in one file beside a prior: what the shards hold, whatever becomes of the
file."""

import shutil

import numpy as np
import pytest

from brrp_cli.prior import kept_parts as module
from brrp_cli.prior.kept_parts import kept_parts
from brrp_cli.prior.store import open_prior, verify_prior

KEYS = ("box", "surface", "pose_T", "distances/spacing", "distances/values")
FIRST = 100


@pytest.fixture
def prior(prior_folder):
    return open_prior(prior_folder)


def kept_file(prior):
    (path,) = (prior.path / "parts").iterdir()
    return path


def assert_same(kept, prior):
    """As the shards have them, to the type; of the surface, its first points."""
    for name, arrays in prior.parts(prior.names, KEYS):
        found = kept.of(name)
        assert list(found) == list(KEYS)
        for key, array in arrays.items():
            expected = array[:FIRST] if key == "surface" else array
            assert found[key].dtype == expected.dtype
            np.testing.assert_array_equal(found[key], expected)


def refuse(*_):
    raise AssertionError("nothing was to be made")


def test_what_is_kept_is_what_the_shards_hold_and_is_not_made_again(prior, monkeypatch):
    assert kept_parts(prior, KEYS, FIRST, make=False) is None
    assert_same(kept_parts(prior, KEYS, FIRST), prior)
    monkeypatch.setattr(module, "_packed", refuse)
    assert_same(kept_parts(prior, KEYS, FIRST, make=False), prior)
    assert verify_prior(prior) == []


def test_other_arrays_take_its_place(prior):
    kept_parts(prior, KEYS, FIRST)
    before = kept_file(prior)
    kept_parts(prior, KEYS, FIRST + 1)
    assert kept_file(prior) != before


@pytest.mark.parametrize("damage", ["cut", "flipped", "text", "lacks"])
def test_a_damaged_file_is_made_anew(prior, damage):
    kept_parts(prior, KEYS, FIRST)
    path = kept_file(prior)
    whole = path.read_bytes()
    if damage == "lacks":
        np.savez(path, box=np.zeros(6))
    else:
        middle = len(whole) // 2
        flipped = whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
        path.write_bytes({"cut": whole[:middle], "flipped": flipped, "text": b"no zip"}[damage])
    assert_same(kept_parts(prior, KEYS, FIRST), prior)
    assert path.read_bytes() == whole


def test_a_prior_that_cannot_be_written_is_used_all_the_same(prior, tmp_path):
    blocked = tmp_path / "blocked"
    shutil.copytree(prior.path, blocked, ignore=lambda *_: ["parts"])
    (blocked / "parts").write_text("a file where the folder would be")
    assert_same(kept_parts(open_prior(blocked), KEYS, FIRST), prior)
