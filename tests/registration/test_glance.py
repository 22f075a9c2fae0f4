"""A glance at solids whose true placement is known."""

from __future__ import annotations

import numpy as np
import pytest
from table_scene import MESHES, placed, stored, verifier_of

from brrp_cli.config import preset
from brrp_cli.registration.glance import coarser, glance
from brrp_cli.registration.model import BareModel, search_model

SEARCH = preset("default").retrieval.alignment.glance


def bare(name: str) -> BareModel:
    model = search_model(stored(name))
    return BareModel(model.field, model.half_extent, model.surface, model.normals, model.resting)


@pytest.mark.parametrize("name", ["box", "ell", "beaker"])
@pytest.mark.parametrize("x, y, yaw", [(0.0, 0.0, 0.3), (0.12, -0.1, 2.0)])
def test_the_true_solid_is_among_the_two_best_at_a_glance(name, x, y, yaw):
    """From one side an L looks like a box, and lies as well."""
    verifier = verifier_of(MESHES[name](), placed(x, y, yaw))
    scores = {other: glance(coarser(bare(other), 100), verifier, SEARCH) for other in MESHES}
    assert scores[name] > 0.7
    assert sum(score > 0.6 for score in scores.values()) <= 2


def test_every_second_node_is_an_eighth_of_the_memory_and_nearly_the_same_surface():
    fine = bare("ell")
    coarse = coarser(fine, 100)
    assert coarse.field.values.size < 0.15 * fine.field.values.size
    assert len(coarse.surface) == len(coarse.normals) == 100
    spacing = coarse.field.spacing * coarse.half_extent
    off = np.abs(coarse.signed_distance(fine.surface))
    assert off.mean() < spacing / 4 and off.max() < spacing
