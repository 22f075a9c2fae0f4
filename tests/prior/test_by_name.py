"""Objects of a prior go between processes by their names."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, replace

import numpy as np
import pytest

from brrp_cli.errors import PriorError
from brrp_cli.prior.by_name import from_bytes, to_bytes
from brrp_cli.prior.store import open_prior


@dataclass
class Held:
    prior: object = None
    stored: object = None
    shape: object = None
    known: object = None


@pytest.fixture
def prior(pristine):
    return open_prior(pristine)


def test_stored_objects_stay_the_same_objects(prior):
    stored = prior.load(prior.names[0])
    seen = np.arange(100_000.0)
    value = Held(stored=stored, shape=stored.shape, known=seen)
    data = to_bytes(value, prior, (seen,))
    again = from_bytes(data, prior, (seen,))
    assert (again.stored, again.shape, again.known) == (stored, stored.shape, seen)
    assert len(data) < 1000


def test_another_process_opens_the_prior_once(prior):
    """It knows the prior by its folder alone."""
    value = Held(prior, prior.load(prior.names[1]))
    one, two = (from_bytes(to_bytes(value, prior)) for _ in range(2))
    assert one.prior is two.prior is not prior
    assert one.prior.digest == prior.digest
    assert one.stored is two.stored is one.prior.load(value.stored.name)


def test_a_shape_of_its_own_is_sent_whole(prior):
    shape = prior.load(prior.names[0]).shape
    bent = replace(shape, vertices=shape.vertices * np.float32(1.1))
    again = from_bytes(to_bytes(bent, prior), prior)
    assert again.vertices.tobytes() == bent.vertices.tobytes()
    origin = np.zeros((1, 3), np.float32)
    assert again.distance(origin) == bent.distance(origin)


def test_scenes_of_open3d_stay_behind(prior):
    shape = prior.load(prior.names[0]).shape
    assert shape.scene is not None
    assert "scene" not in vars(pickle.loads(pickle.dumps(shape)))


def test_a_prior_that_was_built_again_is_told(prior):
    prior.index = replace(prior.index, digest="0" * 64)
    with pytest.raises(PriorError, match="built again"):
        from_bytes(to_bytes(Held(prior), prior))
