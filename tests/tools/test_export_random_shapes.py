import numpy as np
import pytest
import trimesh
from export_random_shapes import one_solid


def boxes(gap):
    """Two cubes of 4 cm, `gap` metres apart along x."""
    parts = [trimesh.creation.box((0.04, 0.04, 0.04)) for _ in range(2)]
    parts[1].apply_translation((0.04 + gap, 0, 0))
    return parts


def test_parts_with_a_gap_become_one_closed_body():
    mesh = trimesh.load(
        trimesh.util.wrap_as_stream(one_solid(boxes(0.0003))), file_type="obj", force="mesh"
    )
    assert mesh.is_volume
    assert mesh.body_count == 1
    np.testing.assert_allclose(mesh.extents, [0.0803, 0.04, 0.04], atol=0.0005)


def test_parts_that_stay_apart_are_left_out():
    assert one_solid(boxes(0.01)) is None


def test_exported_shapes_load_as_scene_models(tmp_path):
    pytest.importorskip("pybullet_data")
    from click.testing import CliRunner
    from export_random_shapes import main

    result = CliRunner().invoke(main, ["--count", "2", "-o", str(tmp_path / "shapes")])
    assert result.exit_code == 0, result.output
    files = sorted((tmp_path / "shapes").iterdir())
    assert [f.name for f in files] == ["000.obj", "001.obj"]
    for file in files:
        mesh = trimesh.load(file, force="mesh")
        assert mesh.is_volume
        assert 0.02 < max(mesh.extents) < 0.2
