"""The main job through the real command: a small prior, a cast frame, files that hold."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from PIL import Image

from brrp_cli import load_frame, make_frame, open_posterior, open_prior, reconstruct
from brrp_cli.cli import main
from brrp_cli.config import Config, FeatureConfig, preset
from brrp_cli.errors import PriorError
from brrp_cli.frames.npz import save_frame
from brrp_cli.geometry import transform_points
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.parameters import AppearanceConfig, BuildParameters
from brrp_cli.raycast import inside, look
from brrp_cli.retrieval.choose import choose_retriever
from brrp_cli.shapes import kinds, solids

K = np.array([[300.0, 0, 159.5], [0, 300.0, 119.5], [0, 0, 1]])
SHAPE = (240, 320)
CAN, BOTTLE, SPECK = 250, -7, 12


def can() -> trimesh.Trimesh:
    return solids.cylinder(0.04, 0.12)


def bottle() -> trimesh.Trimesh:
    return kinds.spray_bottle(radius=0.045, height=0.24, depth_ratio=0.6)


def T_world_cam() -> np.ndarray:
    """A camera half a metre up and away, looking at the middle of the table."""
    eye, target = np.array([0.0, -0.55, 0.5]), np.array([0.0, 0.0, 0.07])
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    T = np.eye(4)
    T[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    T[:3, 3] = eye
    return T


@pytest.fixture(scope="module")
def truth() -> dict[int, trimesh.Trimesh]:
    """World meshes by id."""
    return {CAN: solids.moved(can(), x=-0.1), BOTTLE: solids.moved(bottle(), x=0.1)}


@pytest.fixture(scope="module")
def frame_file(truth, tmp_path_factory) -> Path:
    """A can, a bottle, and a third object of five pixels."""
    table = solids.moved(solids.box(1.2, 1.2, 0.02), z=-0.02)
    T_cam_world = np.linalg.inv(T_world_cam())
    meshes = [m.copy().apply_transform(T_cam_world) for m in [*truth.values(), table]]
    sight = look(meshes, K, SHAPE)
    segmap = np.select([sight.index == 0, sight.index == 1], [CAN, BOTTLE], 0)
    segmap[230, 10:15] = SPECK
    rgb = np.full((*SHAPE, 3), 128, np.uint8)
    path = tmp_path_factory.mktemp("frame") / "frame.npz"
    frame = make_frame(rgb=rgb, segmap=segmap, depth=sight.depth, K=K, T_world_cam=T_world_cam())
    save_frame(frame, path)
    return path


@pytest.fixture(scope="module")
def prior(tmp_path_factory) -> Path:
    meshes = tmp_path_factory.mktemp("meshes")
    can().export(meshes / "can.ply")
    bottle().export(meshes / "bottle.ply")
    out = tmp_path_factory.mktemp("prior") / "prior"
    looks = AppearanceConfig(views=8, rays=500)
    parameters = BuildParameters(
        samples=4000, surface_points=1500, dense_points=5000, appearance=looks
    )
    build_prior(meshes, out, parameters, workers=1)
    return out


def run(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(main, ["reconstruct", *map(str, arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.output


@pytest.fixture(scope="module")
def out(frame_file, prior) -> tuple[Path, int, str]:
    """The command as people type it: results go beside the frame."""
    code, output = run(frame_file, "--prior", prior)
    return frame_file.with_name("frame_brrp"), code, output


@pytest.fixture(scope="module")
def record(out) -> dict:
    return json.loads((out[0] / "result.json").read_text())


def test_writes_everything_and_says_so(out):
    folder, code, output = out
    assert {p.name for p in folder.iterdir()} == {
        "object_250.ply",
        "object_-7.ply",
        "frame.npz",
        "scene.glb",
        "posterior.h5",
        "result.json",
        "preview.png",
    }
    assert code == 3, "the object of five pixels has no mesh"
    last = output.strip().splitlines()[-1]
    assert "2 of 3 objects" in last and str(folder) in last
    assert "Retrieval: appearance" in output, "the retriever is named"


def test_every_object_has_a_status(record):
    by_id = {o["id"]: o for o in record["objects"]}
    assert {i: o["status"] for i, o in by_id.items()} == {
        CAN: "ok",
        BOTTLE: "ok",
        SPECK: "too_few_points",
    }
    assert "5 valid depth points" in by_id[SPECK]["message"]
    assert by_id[BOTTLE]["retrieved"][0]["name"] == "bottle"
    for item in (by_id[BOTTLE], by_id[CAN]):
        total = sum(r["probability"] for r in item["retrieved"]) + item["not_in_prior"]
        assert total == pytest.approx(1) and item["not_in_prior"] < 0.5
    assert by_id[SPECK]["not_in_prior"] == 0


@pytest.mark.parametrize("object_id", [CAN, BOTTLE])
def test_meshes_are_closed_in_metres_in_the_camera_frame(out, truth, object_id):
    mesh = trimesh.load_mesh(out[0] / f"object_{object_id}.ply", process=False)
    assert mesh.is_watertight and mesh.volume > 0
    true = truth[object_id].copy().apply_transform(np.linalg.inv(T_world_cam()))
    points = np.random.default_rng(0).uniform(
        true.bounds[0] - 0.05, true.bounds[1] + 0.05, (4000, 3)
    )
    predicted, expected = inside(mesh, points), inside(true, points)
    iou = (predicted & expected).sum() / (predicted | expected).sum()
    assert iou > 0.5


def scalar(mesh: trimesh.Trimesh) -> np.ndarray:
    """The PLY's property `uncertainty`; trimesh hands unknown properties on as they are."""
    return mesh.metadata["_ply_raw"]["vertex"]["data"]["uncertainty"]


def test_uncertainty_is_a_colour_and_a_scalar_of_each_vertex(out):
    mesh = trimesh.load_mesh(out[0] / "object_250.ply", process=False)
    uncertainty = scalar(mesh)
    assert len(uncertainty) == len(mesh.vertices) == len(mesh.visual.vertex_colors)
    assert np.isfinite(uncertainty).all() and (uncertainty >= 0).all() and uncertainty.max() > 0


def test_the_hidden_side_is_less_certain(out):
    mesh = trimesh.load_mesh(out[0] / "object_250.ply", process=False)
    uncertainty = scalar(mesh)
    towards = np.einsum("ij,ij->i", mesh.vertex_normals, -mesh.vertices) > 0
    assert uncertainty[~towards].mean() > uncertainty[towards].mean()


def test_the_scene_holds_all_meshes(out):
    scene = trimesh.load_scene(out[0] / "scene.glb")
    assert set(scene.geometry) == {"object_250", "object_-7"}
    can_mesh = trimesh.load_mesh(out[0] / "object_250.ply", process=False)
    np.testing.assert_allclose(scene.geometry["object_250"].bounds, can_mesh.bounds, atol=1e-6)


def test_the_posterior_can_be_asked_again(out):
    mesh = trimesh.load_mesh(out[0] / "object_250.ply", process=False)
    posterior = open_posterior(out[0] / "posterior.h5")[CAN]
    # Between two nodes 5 mm apart marching cubes draws a straight line.
    level, step = preset("default").surface.level, 0.005 * mesh.vertex_normals
    assert (posterior.probability(mesh.vertices - step) > level).mean() > 0.95
    assert (posterior.probability(mesh.vertices + step) < level).mean() > 0.95
    far = mesh.bounds.mean(axis=0) + [0, 0, 0.19]
    assert posterior.probability(far[None])[0] < 0.5


def test_the_record_tells_how_to_repeat_it(record, prior):
    assert record["prior"]["digest"] == open_prior(prior).digest
    assert record["seed"] == 0
    assert record["config"]["inference"]["particles"] == 8
    assert record["versions"]["open3d"]
    stages = {"retrieval", "registration", "inference", "surface"}
    assert all(stages <= set(o["seconds"]) for o in record["objects"] if o["status"] == "ok")


def test_the_preview_is_a_picture(out):
    picture = np.asarray(Image.open(out[0] / "preview.png"))
    assert picture.shape[1] == 3 * 480
    assert picture.std() > 10


def test_same_seed_same_bytes_and_world_is_the_camera_frame_moved(out, frame_file, prior, tmp_path):
    folder = tmp_path / "world"
    code, output = run(frame_file, "--prior", prior, "-o", folder, "--frame", "world")
    assert code == 3 and "world frame" in output
    assert (folder / "posterior.h5").read_bytes() == (out[0] / "posterior.h5").read_bytes()
    here = trimesh.load_mesh(out[0] / "object_250.ply", process=False)
    there = trimesh.load_mesh(folder / "object_250.ply", process=False)
    np.testing.assert_allclose(
        transform_points(T_world_cam(), here.vertices), there.vertices, atol=1e-6
    )
    assert there.bounds[0, 2] == pytest.approx(0, abs=0.03), "it stands on the table"


def test_an_existing_folder_is_refused_before_the_work(out, frame_file, prior):
    before = (out[0] / "result.json").stat().st_mtime_ns
    code, output = run(frame_file, "--prior", prior)
    assert code == 1
    assert "--overwrite" in output and "Retrieval" not in output
    assert (out[0] / "result.json").stat().st_mtime_ns == before


def test_world_needs_to_know_where_the_camera_is(frame_file, prior, tmp_path):
    frame = load_frame(frame_file)
    bare = make_frame(
        rgb=frame.rgb, segmap=frame.segmap, depth=np.nan_to_num(frame.points[..., 2]), K=K
    )
    save_frame(bare, tmp_path / "bare.npz")
    code, output = run(tmp_path / "bare.npz", "--prior", prior, "--frame", "world")
    assert code == 1 and "T_world_cam" in output
    assert not (tmp_path / "bare_brrp").exists()


def test_an_output_below_a_file_is_refused(frame_file, prior, tmp_path):
    (tmp_path / "file").write_text("")
    code, output = run(frame_file, "--prior", prior, "-o", tmp_path / "file" / "out")
    assert code == 1 and "Cannot write" in output and "Retrieval" not in output


def test_a_truncated_shard_is_found_before_its_data_are_used(frame_file, prior, tmp_path):
    import shutil

    damaged = tmp_path / "prior"
    shutil.copytree(prior, damaged)
    shard = next((damaged / "shards").glob("*.h5"))
    shard.write_bytes(shard.read_bytes()[:-1000])
    code, output = run(frame_file, "--prior", damaged, "-o", tmp_path / "out")
    assert code == 1 and shard.name in output
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("options", [(), ("--preset", "paper"), ("--method", "vprism")])
def test_where_no_object_gets_a_surface_the_record_is_written_all_the_same(
    frame_file, prior, tmp_path, options
):
    frame = load_frame(frame_file)
    masks = np.where(frame.segmap == SPECK, SPECK, 0)
    depth = np.nan_to_num(frame.points[..., 2])
    save_frame(make_frame(rgb=frame.rgb, segmap=masks, depth=depth, K=K), tmp_path / "speck.npz")
    of_a_prior = () if "vprism" in options else ("--prior", prior)
    code, output = run(tmp_path / "speck.npz", *of_a_prior, *options, "-o", tmp_path / "out")
    assert code == 3
    assert "too_few_points; 5 " in output and "are needed" in output
    assert "Wrote 0 of 1 object" in output and "no mesh: result.json says why" in output
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"frame.npz", "posterior.h5", "result.json", "preview.png"}
    record = json.loads((tmp_path / "out" / "result.json").read_text())
    assert [(o["id"], o["status"], o["mesh"]) for o in record["objects"]] == [
        (SPECK, "too_few_points", None)
    ]
    assert Image.open(tmp_path / "out" / "preview.png").size[0] == 3 * 480
    assert open_posterior(tmp_path / "out" / "posterior.h5") == {}


def test_a_table_of_probabilities_is_used_as_it_is(frame_file, prior, tmp_path):
    table = tmp_path / "table.csv"
    table.write_text(f"object,name,probability\n{CAN},bottle,0.3\n{BOTTLE},bottle,1\n")
    retriever = choose_retriever(str(table), open_prior(prior), preset("default"), 0)
    assert retriever.name == "table"
    np.testing.assert_array_equal(retriever.probabilities(load_frame(frame_file), CAN), [0.3, 0])


def test_a_retriever_is_a_name_or_a_file(frame_file, prior):
    code, output = run(frame_file, "--prior", prior, "--retriever", "magic")
    assert code == 2 and "appearance" in output and "'magic' is neither a file nor" in output


def test_clip_without_its_folder_says_what_to_pass(frame_file, prior, tmp_path, monkeypatch):
    monkeypatch.delenv("BRRP_CLIP_DIR", raising=False)
    code, output = run(frame_file, "--prior", prior, "-o", tmp_path / "out", "--retriever", "clip")
    assert code == 1 and "--clip-dir" in output


def test_another_configuration_than_the_priors_is_refused(frame_file, prior):
    config = Config(features=FeatureConfig(voxel=0.005))
    with pytest.raises(PriorError, match=r"voxel: 0.01 -> 0.005"):
        reconstruct(load_frame(frame_file), open_prior(prior), config=config)


def test_a_damaged_shard_is_never_used(frame_file, prior, tmp_path):
    damaged = Path(shutil.copytree(prior, tmp_path / "prior"))
    for shard in (damaged / "shards").iterdir():
        data = bytearray(shard.read_bytes())
        data[len(data) // 2] ^= 1
        shard.write_bytes(data)
    code, output = run(frame_file, "--prior", damaged, "-o", tmp_path / "out")
    assert code == 1
    assert output.count("A shard is damaged") == 1 and "brrp build-prior" in output
    assert not (tmp_path / "out").exists()


def test_the_posterior_file_of_another_schema_is_refused(out, tmp_path):
    from brrp_cli.errors import BrrpError

    path = tmp_path / "posterior.h5"
    path.write_bytes((out[0] / "posterior.h5").read_bytes())
    with h5py.File(path, "r+") as file:
        file.attrs["schema"] = 99
    with pytest.raises(BrrpError, match="another schema"):
        open_posterior(path)
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(BrrpError, match="cannot be read"):
        open_posterior(path)
