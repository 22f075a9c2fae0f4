"""Meshes stretched along their axes, as people export them."""

import numpy as np
import trimesh
from click.testing import CliRunner
from export_stretched_shapes import main

SIZES = np.array([0.05, 0.08, 0.11])


def exported(folder, *options):
    (folder / "meshes").mkdir(exist_ok=True)
    box = trimesh.creation.box(SIZES)
    box.export(folder / "meshes" / "box.obj")
    # Nothing closes a line.
    (folder / "meshes" / "line.obj").write_text("v 0 0 0\nv 0.1 0 0\nv 0.2 0 0\nf 1 2 3\n")
    out = folder / "stretched"
    result = CliRunner().invoke(main, [str(folder / "meshes"), "-o", str(out), *options])
    assert result.exit_code == 0, result.output
    return result.output, {path.name: path.read_bytes() for path in sorted(out.iterdir())}


def test_each_axis_is_stretched_by_itself(tmp_path):
    said, files = exported(tmp_path, "--copies", "3")
    assert list(files) == ["box~1.ply", "box~2.ply", "box~3.ply"]
    assert "3 shapes, 1 meshes left out" in said
    times = []
    for name in files:
        mesh = trimesh.load(tmp_path / "stretched" / name)
        assert mesh.is_volume
        times.append(mesh.extents / SIZES)
    assert (np.abs(np.log(times)) < 1.2).all()
    # Neither two axes nor two copies are stretched alike.
    assert len(np.unique(np.round(times, 3))) == 9


def test_the_same_seed_gives_the_same_bytes(tmp_path):
    (tmp_path / "other").mkdir()
    _, once = exported(tmp_path, "--seed", "4")
    _, again = exported(tmp_path / "other", "--seed", "4")
    assert once == again
    _, others = exported(tmp_path, "--seed", "5")
    assert all(once[name] != others[name] for name in once)
