import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from PIL import Image

pytest.importorskip("pybullet")

from made_scenes import SIZE, bytes_of, generate, write_two
from make_scenes import main
from tabletop import check
from tabletop.camera import FAR, NEAR, perspective
from tabletop.models import find_meshes, load_model
from tabletop.scene import Plan, make_scene, noisy_buffer
from tabletop.settle import drop

from brrp_cli.errors import MeshError, SceneError
from brrp_cli.geometry import transform_points
from brrp_cli.ground_truth.scenes import find_scenes, true_mesh


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return write_two(tmp_path_factory.mktemp("data"))


@pytest.fixture(scope="module")
def made(data):
    result = generate(data, data / "scenes", "--scenes", 2)
    assert result.exit_code == 0, result.output
    return data / "scenes"


def copy_of(made, target):
    import shutil

    return Path(shutil.copytree(made, target))


def test_varied_light_changes_colours_and_nothing_else(data, made):
    options = ("--scenes", 2, "--light", "varied")
    for folder in ("lit", "lit_again"):
        assert generate(data, data / folder, *options).exit_code == 0
    plain, lit = bytes_of(made), bytes_of(data / "lit")
    assert lit == bytes_of(data / "lit_again")
    changed = {path.name for path in plain if plain[path] != lit[path]}
    assert plain.keys() == lit.keys() and changed == {"rgb.jpg"}
    means = [
        np.asarray(Image.open(data / "lit" / scene / "0000" / "rgb.jpg")).mean(axis=(0, 1))
        / np.asarray(Image.open(made / scene / "0000" / "rgb.jpg")).mean(axis=(0, 1))
        for scene in ("00000000", "00000001")
    ]
    assert np.abs(np.log(means[0] / means[1])).max() > 0.05, "each scene has its own light"


def test_layout_is_the_published_one(made):
    assert sorted(p.name for p in made.iterdir()) == ["00000000", "00000001"]
    entries = json.loads((made / "00000000" / "objects.json").read_text())
    assert 3 <= len(entries) <= 10
    for entry in entries:
        assert set(entry) == {"id", "mesh_path", "position", "orientation", "scale"}
        assert (len(entry["position"]), len(entry["orientation"])) == (3, 4)
        assert entry["mesh_path"].startswith("meshes/00")
    for view in ("0000", "0001"):
        folder = made / "00000000" / view
        depth, ids = np.load(folder / "depth.npy"), np.load(folder / "seg_mask.npy")
        assert (depth.shape, depth.dtype, depth.max() <= 1) == ((120, 160), np.float32, True)
        assert ids.shape == (120, 160)
        assert ids.dtype.kind == "i"
        assert set(np.unique(ids)) <= {0} | {entry["id"] for entry in entries}
        assert Image.open(folder / "rgb.jpg").size == (160, 120)
        with np.load(folder / "camera.npz") as camera:
            assert {k: camera[k].shape for k in camera} == {
                "projection_matrix": (4, 4),
                "view_matrix": (4, 4),
            }


def test_a_scene_depends_on_seed_and_number_alone(data, made):
    meshes = tuple(find_meshes(data / "meshes"))
    for seed, folder in ((0, "again"), (1, "other")):
        plan = Plan(meshes, data, data / folder, seed, 2, "none", (160, 120), False)
        make_scene(plan, 1, check=False)
    first = bytes_of(made / "00000001")
    assert bytes_of(data / "again" / "00000001") == first
    other = bytes_of(data / "other" / "00000001")
    for different in (other, bytes_of(made / "00000000")):
        assert different[Path("objects.json")] != first[Path("objects.json")]
        assert different[Path("0000/camera.npz")] != first[Path("0000/camera.npz")]


def test_frames_show_the_objects_where_they_are(data, made):
    colors = {"001_red": 0, "002_blue": 2}
    seen = 0
    for scene in find_scenes(made):
        frame = scene.view(0)
        for object_id in frame.object_ids:
            truth = scene.object(object_id)
            points = transform_points(
                frame.T_world_cam, frame.object_points(object_id).astype(np.float64)
            )
            lower, upper = true_mesh(truth, data).bounds
            assert (points > lower - 1e-4).all()
            assert (points < upper + 1e-4).all()
            if len(points) > 100:
                seen += 1
                color = np.median(frame.rgb[frame.segmap == object_id], axis=0)
                assert color.argmax() == colors[truth.name]
    assert seen >= 4


def test_objects_lie_on_the_table(data, made):
    for path in find_meshes(data / "meshes"):
        model = load_model(path)
        for seed in range(4):
            (pose,) = drop([model], np.random.default_rng(seed))
            assert pose.apply(model.vertices)[:, 2].min() == pytest.approx(0, abs=0.002)
    for scene in find_scenes(made):
        lowest = [true_mesh(o, data).bounds[0, 2] for o in scene.objects]
        assert min(lowest) == pytest.approx(0, abs=0.002)


def test_check_fails_when_a_pose_is_wrong_by_a_centimetre(data, made, tmp_path):
    scenes = copy_of(made, tmp_path / "scenes")
    arguments = ["--check", "--data-root", str(data), "-o", str(scenes)]
    passed = CliRunner().invoke(main, arguments)
    assert passed.exit_code == 0, passed.output
    assert "in 4 views checked" in passed.output

    path = scenes / "00000001" / "objects.json"
    entries = json.loads(path.read_text())
    seen = np.unique(np.load(path.parent / "0000" / "seg_mask.npy"))[1]
    moved = next(entry for entry in entries if entry["id"] == seen)
    moved["position"][2] += 0.01
    path.write_text(json.dumps(entries))
    failed = CliRunner().invoke(main, arguments)
    assert failed.exit_code == 1
    assert "do not lie on the posed mesh" in failed.output
    assert f"object {seen} (" in failed.output


def test_of_measured_depth_half_of_the_objects_may_lie_elsewhere(made, data, tmp_path, monkeypatch):
    monkeypatch.setattr(check, "SENSOR_PIXELS", check.MIN_PIXELS)  # in small images
    scene = copy_of(made, tmp_path / "scenes") / "00000001"
    assert all(each.median < check.CLEAN[0] for each in check.check_measured_scene(scene, data))
    path = scene / "objects.json"
    entries = json.loads(path.read_text())
    for count, fails in ((1, False), (len(entries), True)):
        for entry in entries[:count]:
            entry["position"][2] = 1.0
        path.write_text(json.dumps(entries))
        if fails:
            with pytest.raises(SceneError, match="for half of the objects"):
                check.check_measured_scene(scene, data)
        else:
            check.check_measured_scene(scene, data)


def test_check_fails_on_an_id_that_is_no_objects(data, made, tmp_path):
    scenes = copy_of(made, tmp_path / "scenes")
    path = scenes / "00000000" / "0000" / "seg_mask.npy"
    ids = np.load(path)
    ids[0, 0] = 99
    np.save(path, ids)
    failed = CliRunner().invoke(main, ["--check", "--data-root", str(data), "-o", str(scenes)])
    assert failed.exit_code == 1
    assert "seg_mask.npy" in failed.output
    assert "99" in failed.output


def test_a_check_that_sees_no_object_is_no_success(data, made, tmp_path):
    scenes = copy_of(made, tmp_path / "scenes")
    for path in scenes.glob("*/*/seg_mask.npy"):
        np.save(path, np.zeros((120, 160), np.int32))
    failed = CliRunner().invoke(main, ["--check", "--data-root", str(data), "-o", str(scenes)])
    assert failed.exit_code == 1
    assert "Nothing could be checked" in failed.output


def test_noise_changes_depth_alone(data, made):
    result = generate(data, data / "noisy", "--scenes", 1, "--noise", "structured-light")
    assert result.exit_code == 0, result.output
    clean, noisy = bytes_of(made / "00000000"), bytes_of(data / "noisy" / "00000000")
    changed = {path.name for path in clean if clean[path] != noisy[path]}
    assert changed == {"depth.npy"}


def test_noisy_buffer_keeps_metres_and_marks_missing_pixels():
    projection = perspective((64, 48))
    depth = np.full((48, 64), 0.8)
    depth[:, 40:] = 0.6
    depth[:5] = FAR  # nothing there
    buffer = (FAR / (FAR - NEAR) * (1 - NEAR / depth)).astype(np.float32)
    noisy = noisy_buffer(buffer, projection, np.random.default_rng(0))
    metres = FAR * NEAR / (FAR - noisy * (FAR - NEAR))
    returned = noisy < 1
    assert not returned[:5].any()
    assert not returned[6:-1, 39:41].any()  # the depth edge
    assert returned[8:-2, 45:].all()
    error = (metres - depth)[returned]
    assert abs(error.mean()) < 0.001
    assert 0.0005 < error.std() < 0.005


def test_meshes_are_chosen_by_name(data, tmp_path):
    names = ["030_fork", "065-d_cups", "065_other"]
    for name in names:
        trimesh.creation.box((1, 1, 1)).export(tmp_path / f"{name}.ply")
    assert [p.stem for p in find_meshes(tmp_path)] == names
    assert [p.stem for p in find_meshes(tmp_path, only=["030", "065-d"])] == names[:2]
    assert [p.stem for p in find_meshes(tmp_path, skip=["065"])] == names[:2]
    assert [p.parent.parent.name for p in find_meshes(data / "meshes")] == ["001_red", "002_blue"]
    with pytest.raises(MeshError, match="3 meshes before"):
        find_meshes(tmp_path, only=["999"])


def test_existing_scenes_are_kept_and_mistakes_are_told(data, made, tmp_path):
    again = generate(data, made, "--scenes", 1)
    assert again.exit_code == 1
    assert "--overwrite" in again.output
    elsewhere = generate(data, tmp_path / "s", "--data-root", tmp_path)
    assert elsewhere.exit_code == 2
    assert "does not lie below --data-root" in elsewhere.output
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad" / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    bad = CliRunner().invoke(
        main, ["--meshes", str(tmp_path / "bad"), "-o", str(tmp_path / "s"), "--size", SIZE]
    )
    assert bad.exit_code == 1
    assert "flat.obj" in bad.output


def test_a_sensor_changes_depth_alone_and_repeats_its_bytes(data, made):
    pytest.importorskip("cv2")
    clean = bytes_of(made / "00000000")
    depths = set()
    for sensor in ("stereo", "xtion", "kinect-azure"):
        for folder in (sensor, f"{sensor}_again"):
            result = generate(data, data / folder, "--scenes", 1, "--sensor", sensor)
            assert result.exit_code == 0, result.output
        measured = bytes_of(data / sensor / "00000000")
        assert measured == bytes_of(data / f"{sensor}_again" / "00000000")
        assert {p.name for p in clean if clean[p] != measured[p]} == {"depth.npy"}
        depths.add(measured[Path("0000/depth.npy")])
        before, after = (
            np.load(folder / "00000000" / "0000" / "depth.npy") for folder in (made, data / sensor)
        )
        assert 0.5 < ((after < 1) & (before < 1)).mean() / (before < 1).mean() < 1
    assert len(depths) == 3


def test_a_dark_table_is_black_and_has_less_depth(data, tmp_path):
    seen = {}
    for name, dark in (("usual", ()), ("dark", ("--dark-table",))):
        options = ("--scenes", 1, "--sensor", "xtion", *dark)
        result = generate(data, tmp_path / name, *options)
        assert result.exit_code == 0, result.output
        folder = tmp_path / name / "00000000"
        view = {file: np.load(folder / "0000" / f"{file}.npy") for file in ("depth", "seg_mask")}
        rgb = np.asarray(Image.open(folder / "0000" / "rgb.jpg"))
        seen[name] = ((folder / "objects.json").read_bytes(), view, rgb)
    (poses, usual, bright), (same, dark, black) = seen["usual"], seen["dark"]
    assert poses == same
    np.testing.assert_array_equal(usual["seg_mask"], dark["seg_mask"])
    table = (usual["seg_mask"] == 0) & (usual["depth"] < 1)
    assert black[table].mean() < 0.3 * bright[table].mean()
    assert (dark["depth"] < 1)[table].mean() < 0.8
    things = (usual["seg_mask"] > 0) & (usual["depth"] < 1)
    assert (dark["depth"] < 1)[things].mean() > 0.9


def test_noise_and_sensor_exclude_each_other(data, tmp_path):
    both = generate(data, tmp_path / "s", "--noise", "structured-light", "--sensor", "xtion")
    assert both.exit_code == 2
    assert "exclude each other" in both.output


def test_the_options_say_where_cameras_stand(data, made):
    result = generate(data, data / "above", "--scenes", 1, "--elevation", 80, 85, "--roll", 30, 30)
    assert result.exit_code == 0, result.output
    (scene,) = find_scenes(data / "above")
    T_world_cam = scene.view(0).T_world_cam
    assert 80 <= np.rad2deg(np.arcsin(-T_world_cam[2, 2])) <= 85
    # Of what points down, the image's axes see the cosine and the sine of the roll.
    slant = np.arctan2(T_world_cam[2, 0], T_world_cam[2, 1])
    assert abs(np.rad2deg(slant)) == pytest.approx(150, abs=1e-3)
    assert (data / "above" / "00000000" / "objects.json").read_bytes() == (
        made / "00000000" / "objects.json"
    ).read_bytes()
    refused = generate(data, data / "none", "--distance", 0.05, 0.5)
    assert refused.exit_code != 0 and "--distance" in refused.output
    assert not (data / "none").exists()
