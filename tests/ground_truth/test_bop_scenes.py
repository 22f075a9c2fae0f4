"""BOP data sets as scenes with truth, through `brrp eval`."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from table_scene import SHAPE, T_CAM_WORLD, K, in_camera, photograph

from brrp_cli.cli import main
from brrp_cli.dependencies import import_open3d
from brrp_cli.errors import SceneError
from brrp_cli.geometry import similarity
from brrp_cli.ground_truth.scenes import find_scenes, true_mesh_in_camera
from brrp_cli.shapes import solids

PLACES = {1: (0.0, -0.08), 2: (0.0, 0.08)}


@pytest.fixture(scope="module")
def data_set(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two boxes, models in millimetres, one image with masks and one without."""
    root = tmp_path_factory.mktemp("bop")
    scene = root / "test" / "000001"
    meshes = {1: solids.box(0.06, 0.08, 0.10), 2: solids.box(0.05, 0.05, 0.14)}
    poses = {
        i: T_CAM_WORLD @ similarity(1.0, np.eye(3), np.array([*PLACES[i], 0.0])) for i in PLACES
    }
    frame = photograph({i: in_camera(meshes[i], poses[i]) for i in meshes})
    (root / "models").mkdir(parents=True)
    for i, mesh in meshes.items():
        mesh.copy().apply_scale(1000).export(root / f"models/obj_{i:06d}.ply")
    for kind in ("rgb", "depth", "mask_visib"):
        (scene / kind).mkdir(parents=True)
    depth = np.nan_to_num(frame.points[..., 2])
    for image in (0, 5):
        Image.fromarray(frame.rgb).save(scene / f"rgb/{image:06d}.png")
        raw = (depth * 10_000).round().astype(np.uint16)
        Image.fromarray(raw).save(scene / f"depth/{image:06d}.png")
    for place, i in enumerate(PLACES):
        mask = (frame.segmap == i).astype(np.uint8) * 255
        Image.fromarray(mask).save(scene / f"mask_visib/000005_{place:06d}.png")
    camera = {"cam_K": K.ravel().tolist(), "depth_scale": 0.1}
    truth = [
        {
            "obj_id": i,
            "cam_R_m2c": poses[i][:3, :3].ravel().tolist(),
            "cam_t_m2c": (poses[i][:3, 3] * 1000).tolist(),
        }
        for i in PLACES
    ]
    (scene / "scene_camera.json").write_text(json.dumps({"0": camera, "5": camera}))
    (scene / "scene_gt.json").write_text(json.dumps({"0": truth, "5": truth}))
    return root


@pytest.mark.parametrize("below", ["", "test", "test/000001"])
def test_images_with_masks_are_scenes_and_the_truth_lies_on_the_points(
    data_set: Path, below: str
) -> None:
    o3d = import_open3d()
    (scene,) = find_scenes(data_set / below)
    assert scene.name == "000001_000005"
    frame = scene.view(0)
    assert frame.shape == SHAPE
    assert frame.object_ids == [1, 2]
    for true in scene.objects:
        mesh = true_mesh_in_camera(true, data_set, frame.T_world_cam)
        points = frame.object_points(true.id)
        caster = o3d.t.geometry.RaycastingScene()
        tensor = o3d.core.Tensor
        caster.add_triangles(
            tensor(np.array(mesh.vertices, np.float32)), tensor(np.array(mesh.faces, np.uint32))
        )
        distance = caster.compute_distance(points).numpy()
        assert np.median(distance) < 2e-4


def test_missing_models_are_told(data_set: Path, tmp_path: Path) -> None:

    shutil.copytree(data_set / "test", tmp_path / "alone" / "test")
    with pytest.raises(SceneError, match="models are not there"):
        find_scenes(tmp_path / "alone")


@pytest.mark.slow
def test_eval_scores_them(data_set: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("point_cloud_utils")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    arguments = ["eval", data_set, "--method", "vprism", "--workers", 1, "-o", tmp_path / "out"]
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.output
    with (tmp_path / "out" / "metrics.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["name"] for row in rows] == ["obj_000001", "obj_000002"]
    assert all(float(row["iou"]) > 0.4 for row in rows)
