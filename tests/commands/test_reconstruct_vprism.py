"""A frame without a prior through the real command: two boxes a finger apart."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from PIL import Image

from brrp_cli import load_frame, make_frame, open_posterior, reconstruct, write_results
from brrp_cli.cli import main
from brrp_cli.config import VPrismConfig
from brrp_cli.errors import BrrpError, PriorError
from brrp_cli.frames.npz import save_frame
from brrp_cli.raycast import inside, look
from brrp_cli.shapes import solids

K = np.array([[240.0, 0, 119.5], [0, 240.0, 89.5], [0, 0, 1]])
SHAPE = (180, 240)
LEFT, RIGHT, SPECK = 40, -2, 7


def T_cam_world() -> np.ndarray:
    """A camera in front of and above the table, which looks down by 40 degrees."""
    s, c = np.sin(np.radians(40)), np.cos(np.radians(40))
    T_world_cam = np.eye(4)
    T_world_cam[:3, :3] = np.array([[1, 0, 0], [0, -s, c], [0, -c, -s]])
    T_world_cam[:3, 3] = [0, -0.5, 0.45]
    return np.linalg.inv(T_world_cam)


@pytest.fixture(scope="module")
def truth() -> dict[int, trimesh.Trimesh]:
    """Meshes by id, camera frame; between the boxes is a gap of 1.5 cm."""
    boxes = {
        LEFT: solids.moved(solids.box(0.08, 0.07, 0.12), x=-0.0475),
        RIGHT: solids.moved(solids.box(0.10, 0.08, 0.08), x=0.0575),
    }
    return {i: mesh.apply_transform(T_cam_world()) for i, mesh in boxes.items()}


@pytest.fixture(scope="module")
def frame_file(truth, tmp_path_factory) -> Path:
    """The two boxes and a third object of six pixels."""
    table = solids.moved(solids.box(1.2, 1.2, 0.02), z=-0.02).apply_transform(T_cam_world())
    sight = look([*truth.values(), table], K, SHAPE)
    segmap = np.select([sight.index == 0, sight.index == 1], [LEFT, RIGHT], 0)
    segmap[170, 20:26] = SPECK
    path = tmp_path_factory.mktemp("frame") / "frame.npz"
    rgb = np.full((*SHAPE, 3), 128, np.uint8)
    save_frame(make_frame(rgb=rgb, segmap=segmap, depth=sight.depth, K=K), path)
    return path


def run(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(main, ["reconstruct", *map(str, arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.output


@pytest.fixture(scope="module")
def out(frame_file, tmp_path_factory) -> tuple[Path, int, str]:
    """As people type it, on a machine where there is no prior and none can be built."""
    nowhere = tmp_path_factory.mktemp("home") / "file"
    nowhere.touch()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BRRP_PRIOR", str(nowhere / "prior"))
        patch.setenv("XDG_DATA_HOME", str(nowhere))
        code, output = run(frame_file, "--method", "vprism", "--seed", 3)
    return frame_file.with_name("frame_vprism"), code, output


@pytest.fixture(scope="module")
def again(frame_file):
    """The same in Python."""
    return reconstruct(load_frame(frame_file), method="vprism", seed=3)


@pytest.fixture(scope="module")
def meshes(out) -> dict[int, trimesh.Trimesh]:
    return {i: trimesh.load_mesh(out[0] / f"object_{i}.ply", process=False) for i in (LEFT, RIGHT)}


def test_writes_what_brrp_writes_and_says_so(out):
    folder, code, output = out
    assert {p.name for p in folder.iterdir()} == {
        "object_40.ply",
        "object_-2.ply",
        "frame.npz",
        "scene.glb",
        "posterior.h5",
        "result.json",
        "preview.png",
    }
    assert code == 3, "the object of six pixels has no mesh"
    assert "without a prior" in output and "Prior:" not in output and "2 of 3" in output
    assert np.asarray(Image.open(folder / "preview.png")).std() > 10


@pytest.mark.parametrize("object_id", [LEFT, RIGHT])
def test_meshes_are_closed_and_near_the_truth(meshes, truth, object_id):
    mesh, true = meshes[object_id], truth[object_id]
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0
    lower, upper = true.bounds
    points = np.random.default_rng(0).uniform(lower - 0.05, upper + 0.05, (4000, 3))
    predicted, expected = inside(mesh, points), inside(true, points)
    assert (predicted & expected).sum() / (predicted | expected).sum() > 0.5


def test_neighbours_do_not_stand_in_each_other(meshes):
    lower, upper = meshes[RIGHT].bounds
    points = np.random.default_rng(0).uniform(lower, upper, (20_000, 3))
    left, right = inside(meshes[LEFT], points), inside(meshes[RIGHT], points)
    assert right.mean() > 0.2
    assert (left & right).sum() < 0.01 * right.sum()


def test_the_hidden_side_is_less_certain(meshes):
    mesh = meshes[LEFT]
    uncertainty = mesh.metadata["_ply_raw"]["vertex"]["data"]["uncertainty"]
    assert len(uncertainty) == len(mesh.vertices) and (uncertainty >= 0).all()
    towards = np.einsum("ij,ij->i", mesh.vertex_normals, -mesh.vertices) > 0
    assert uncertainty[~towards].mean() > uncertainty[towards].mean()


def test_the_record_names_the_method_and_no_prior(out):
    record = json.loads((out[0] / "result.json").read_text())
    assert record["method"] == "vprism" and record["seed"] == 3
    assert record["prior"] is None and record["retriever"] is None
    assert record["config"]["gamma"] == VPrismConfig().gamma
    assert record["config"]["surface"]["level"] == 0.5
    assert not {"k", "preset", "registration", "inference"} & set(record["config"])
    assert record["plane_cam"] is not None
    by_id = {o["id"]: o for o in record["objects"]}
    assert {i: o["status"] for i, o in by_id.items()} == {
        LEFT: "ok",
        RIGHT: "ok",
        SPECK: "too_few_points",
    }
    assert by_id[LEFT]["retrieved"] == []
    assert set(by_id[LEFT]["seconds"]) == {"inference", "surface"}


def test_python_and_the_command_give_the_same_bytes(out, again, tmp_path):
    write_results(again, tmp_path / "again")
    for name in ("object_40.ply", "object_-2.ply", "posterior.h5", "scene.glb", "preview.png"):
        assert (tmp_path / "again" / name).read_bytes() == (out[0] / name).read_bytes(), name


def test_the_posterior_can_be_asked_again(out, again):
    found = open_posterior(out[0] / "posterior.h5")
    assert set(found) == {LEFT, RIGHT}
    for item in again.reconstructed:
        vertices = item.surface.vertices
        np.testing.assert_array_equal(
            found[item.object_id].probability(vertices), item.posterior.probability(vertices)
        )
        np.testing.assert_array_equal(
            found[item.object_id].uncertainty(vertices), item.surface.uncertainty
        )


@pytest.mark.parametrize(
    "options",
    [
        ("--prior", "prior/"),
        ("--k", 3),
        ("--preset", "paper"),
        ("--retriever", "uniform"),
        ("--clip-dir", "clip/"),
        ("--device", "cuda"),
    ],
)
def test_options_without_a_meaning_are_refused(frame_file, tmp_path, options):
    code, output = run(frame_file, "--method", "vprism", "-o", tmp_path / "out", *options)
    assert code == 2
    assert (options[0] if options[0] != "--device" else "CPU") in output
    assert not (tmp_path / "out").exists()


def test_python_refuses_what_does_not_fit(frame_file):
    frame = load_frame(frame_file)
    with pytest.raises(PriorError, match="brrp needs a prior"):
        reconstruct(frame)
    with pytest.raises(BrrpError, match="No such method"):
        reconstruct(frame, method="guess")
    with pytest.raises(BrrpError, match="vprism uses no prior"):
        reconstruct(frame, object(), method="vprism")


def test_what_is_measured_alone_does_not_pass_for_a_reconstruction(frame_file, tmp_path):
    code, output = run(frame_file, "--method", "retrieval", "-o", tmp_path / "out")
    assert code == 2
    assert "'brrp', 'vprism'" in output
    assert not (tmp_path / "out").exists()
    with pytest.raises(BrrpError, match="No such method"):
        reconstruct(load_frame(frame_file), object(), method="retrieval")
