"""Models that retrieval holds, read from shards or from the file beside the prior."""

import shutil

import numpy as np

from brrp_cli.config import preset
from brrp_cli.prior.store import open_prior
from brrp_cli.registration.model import search_model
from brrp_cli.retrieval.held_models import PARTS, HeldModels, bare_model


def test_models_that_are_kept_beside_the_prior_are_those_of_the_shards(prior, tmp_path):
    """A glance at all keeps them, and the next command reads no shard."""
    copied = tmp_path / "prior"
    shutil.copytree(prior.path, copied, ignore=lambda *_: ["parts"])
    own = preset("default").retrieval.alignment
    fresh, names = HeldModels(open_prior(copied), own), prior.names
    read = fresh.of(names)
    glanced_at = fresh.coarse(names)
    shutil.rmtree(copied / "shards")
    kept = HeldModels(open_prior(copied), own)
    found = kept.of(names) + kept.coarse(names)
    for one, other in zip(read + glanced_at, found, strict=True):
        assert one.half_extent == other.half_extent
        for arrays in ((one.field.values, other.field.values), (one.surface, other.surface)):
            assert arrays[0].dtype == arrays[1].dtype
            np.testing.assert_array_equal(*arrays)
        np.testing.assert_array_equal(one.normals, other.normals)
        np.testing.assert_array_equal(one.resting, other.resting)


def test_a_model_that_is_read_alone_is_that_of_the_object(prior):
    ((_, arrays),) = prior.parts(["red_can"], PARTS)
    whole, alone = search_model(prior.load("red_can")), bare_model(arrays, 150)
    points = np.random.default_rng(0).uniform(-0.2, 0.2, (50, 3))
    np.testing.assert_allclose(alone.signed_distance(points), whole.signed_distance(points))
    np.testing.assert_array_equal(alone.resting, whole.resting)
    np.testing.assert_array_equal(alone.surface, whole.surface[:150])
    np.testing.assert_array_equal(alone.normals, whole.normals[:150])
