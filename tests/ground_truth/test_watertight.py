"""The published way to close a true mesh."""

import sys

import numpy as np
import pytest
import trimesh
from for_people import assert_for_people

from brrp_cli.errors import DependencyError, SceneError
from brrp_cli.ground_truth.watertight import CHAMFER_RESOLUTION, IOU_RESOLUTION, published_truth
from brrp_cli.raycast import inside
from brrp_cli.shapes import solids


@pytest.fixture(autouse=True)
def _needs_point_cloud_utils(request):
    if "without" not in request.node.name:
        pytest.importorskip("point_cloud_utils", reason="the extra `eval` is not installed")


def open_box():
    box = trimesh.creation.box((0.1, 0.06, 0.2))
    box.update_faces(np.arange(len(box.faces)) > 1)
    return box


def test_an_open_mesh_becomes_closed_around_the_same_place():
    closed = published_truth(solids.box(0.1, 0.06, 0.2), IOU_RESOLUTION)
    assert closed.is_watertight
    assert closed.volume > 0
    np.testing.assert_allclose(closed.extents, [0.1, 0.06, 0.2], atol=0.007)
    np.testing.assert_allclose(closed.bounds.mean(axis=0), [0, 0, 0.1], atol=0.001)
    assert published_truth(open_box(), IOU_RESOLUTION).is_watertight


def test_it_thickens_shells_and_less_so_at_the_finer_resolution():
    bowl = solids.spherical_bowl(0.035, 0.08, 0.055, 0.003)
    for_iou = published_truth(bowl, IOU_RESOLUTION)
    for_chamfer = published_truth(bowl, CHAMFER_RESOLUTION)
    assert for_iou.volume > for_chamfer.volume > 1.3 * bowl.volume
    assert not inside(for_iou, np.array([[0, 0, 0.03]]))[0]


def test_the_kept_mesh_is_the_same_and_follows_the_content(tmp_path):
    cache = tmp_path / "kept"
    box = solids.box(0.1, 0.06, 0.2)
    fresh = published_truth(box, 1000, cache)
    kept = published_truth(box, 1000, cache)
    assert kept.vertices.tobytes() == fresh.vertices.tobytes()
    assert kept.faces.tobytes() == fresh.faces.tobytes()
    assert len(list(cache.iterdir())) == 1
    published_truth(solids.box(0.1, 0.06, 0.21), 1000, cache)
    published_truth(box, 4000, cache)
    assert len(list(cache.iterdir())) == 3


def test_a_damaged_kept_mesh_is_told(tmp_path):
    box = solids.box(0.1, 0.06, 0.2)
    published_truth(box, 1000, tmp_path)
    (kept,) = tmp_path.iterdir()
    whole = kept.read_bytes()
    for damaged in (b"", b"junk", whole[: len(whole) // 2], bytes(200) + whole[200:]):
        kept.write_bytes(damaged)
        with pytest.raises(
            SceneError, match=r"kept of a true mesh(.|\n)*remove the file"
        ) as caught:
            published_truth(box, 1000, tmp_path)
        assert str(kept) in str(caught.value)
        assert_for_people(caught.value)


def test_without_the_extra_the_message_names_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "point_cloud_utils", None)
    with pytest.raises(DependencyError, match="point_cloud_utils") as caught:
        published_truth(solids.box(0.1, 0.1, 0.1), 1000)
    assert "brrp-cli[eval]" in str(caught.value)
