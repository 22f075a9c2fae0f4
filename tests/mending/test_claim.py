"""Masks that recognised objects claim, on the way from a frame to a reconstruction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from table_scene import T_CAM_WORLD, TABLE, in_camera, photograph

from brrp_cli.config.mending import MendConfig
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.geometry import similarity
from brrp_cli.mending.again import Again
from brrp_cli.mending.claim import mended_masks
from brrp_cli.mending.explain import rendered
from brrp_cli.mending.mend import mend
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.store import open_prior
from brrp_cli.reconstruction import OK, ObjectReconstruction, Reconstruction, Retrieved
from brrp_cli.shapes import solids

BOX = solids.box(0.12, 0.10, 0.10)


@pytest.fixture(scope="module")
def prior(tmp_path_factory):
    from small_prior import SMALL

    folder = tmp_path_factory.mktemp("prior")
    (folder / "meshes").mkdir()
    BOX.export(folder / "meshes" / "box.ply")
    build_prior(folder / "meshes", folder / "prior", SMALL)
    return open_prior(folder / "prior")


def placed(prior, weight=0.95):
    """The stored box where `BOX` stands."""
    stored = prior.load("box")
    T_mesh_object = similarity(stored.half_extent, np.eye(3), stored.center)
    return Retrieved("box", 1.0, T_CAM_WORLD @ T_mesh_object, weight=weight)


def reconstruction(frame, objects):
    return Reconstruction(
        frame=frame,
        objects=objects,
        plane=TABLE,
        method="brrp",
        retriever=None,
        prior_path=None,
        prior_digest=None,
        configuration={},
        seed=0,
        device="cpu",
    )


def test_a_placed_object_is_rendered_where_it_is_seen(prior):
    frame = photograph({1: in_camera(BOX, T_CAM_WORLD)})
    depth = rendered(placed(prior), prior, frame)
    mask = frame.segmap == 1
    assert ((depth > 0) ^ mask).sum() < 0.02 * mask.sum()
    both = mask & (depth > 0)
    assert np.median(np.abs(depth - frame.points[..., 2])[both]) < 0.001


def test_what_changed_is_reconstructed_again_and_nothing_else(prior):
    other = in_camera(solids.moved(solids.box(0.06, 0.06, 0.05), x=0.2), T_CAM_WORLD)
    whole = photograph({1: in_camera(BOX, T_CAM_WORLD), 2: other})
    middle = np.median(np.nonzero(whole.segmap == 1)[1])
    cut = (whole.segmap == 1) & (np.arange(whole.shape[1]) > middle)
    frame = replace(whole, segmap=np.where(cut, 3, whole.segmap))
    objects = [ObjectReconstruction(i, OK) for i in (1, 2, 3)]
    objects[0] = ObjectReconstruction(1, OK, retrieved=[placed(prior)])
    first = reconstruction(frame, objects)
    asked = []

    def infer(frame, only, **known):
        asked.append(([*frame.object_ids], [*only]))
        return reconstruction(frame, [ObjectReconstruction(1, OK, n_points=5)])

    again = Again(infer, pytest.fail)
    result = mend(first, prior, again, SegmentConfig())
    assert asked == [([1, 2], [1])]
    assert [item.n_points for item in result.objects] == [5, objects[1].n_points]
    assert np.array_equal(result.frame.segmap, whole.segmap)
    assert "mending" in result.seconds
    never = mend(first, prior, again, SegmentConfig(mend=MendConfig(rounds=0)))
    assert never.frame is frame and len(asked) == 1
    doubtful = replace(first, objects=[ObjectReconstruction(1, OK, retrieved=[placed(prior, 0.6)])])
    assert mended_masks(doubtful, prior, MendConfig()).segmap is frame.segmap
