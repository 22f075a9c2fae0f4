"""True objects are found in the prior by what their files hold, then by their names."""

import numpy as np
import pytest
import trimesh

from brrp_cli.evaluation.match_names import match_names
from brrp_cli.ground_truth.scenes import Scene
from brrp_cli.ground_truth.truth import TrueObject
from brrp_cli.prior.build.mesh_files import input_sha256
from brrp_cli.prior.manifest import ObjectEntry


def scene_of(*paths):
    objects = tuple(TrueObject(i, path, np.eye(4)) for i, path in enumerate(paths, start=1))
    return Scene("one", paths[0], objects, ())


def entry(name, sha256="0" * 64):
    return ObjectEntry(name, name, f"{name}.obj", sha256, "shards/shard-1.h5", {})


@pytest.fixture
def data(tmp_path):
    """red_mug/textured.obj and blue_mug/textured.obj, which differ."""
    for size, name in enumerate(("red_mug", "blue_mug"), start=1):
        (tmp_path / name).mkdir()
        trimesh.creation.box((size, 1, 1)).export(tmp_path / name / "textured.obj")
    return tmp_path


def test_content_comes_before_the_name(data):
    sha256 = input_sha256(data / "red_mug" / "textured.obj")
    entries = [entry("blue_mug"), entry("cup_017", sha256), entry("red_mug")]
    scenes, matched = match_names(
        [scene_of("red_mug/textured.obj", "blue_mug/textured.obj")], data, entries
    )
    assert [o.name for o in scenes[0].objects] == ["cup_017", "blue_mug"]
    assert matched == 2


def test_of_two_with_one_content_the_one_of_that_name(data):
    sha256 = input_sha256(data / "red_mug" / "textured.obj")
    entries = [entry("a_copy", sha256), entry("red_mug", sha256)]
    scenes, _ = match_names([scene_of("red_mug/textured.obj")], data, entries)
    assert scenes[0].objects[0].name == "red_mug"


def test_what_the_prior_does_not_hold_keeps_its_name_and_is_counted(data):
    scenes, matched = match_names([scene_of("red_mug/textured.obj", "no.obj")], data, [entry("x")])
    assert [o.name for o in scenes[0].objects] == ["red_mug", "no"]
    assert matched == 0


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("ycb/011_banana/google_16k/textured.obj", "011_banana"),
        ("ycb/011_banana/textured.obj", "011_banana"),
        ("011_banana/textured.obj", "011_banana"),
        ("textured.obj", "textured"),
        ("shapes/can.obj", "can"),
    ],
)
def test_names_by_layout(path, name):
    assert TrueObject(1, path, np.eye(4)).name == name
