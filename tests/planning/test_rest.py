"""Where scenes come to rest: boxes and balls whose place is known."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from made_result import BOX, ELL, write_made_result
from measure_rest import report, stillness, stillness_in_pybullet
from scipy.spatial.transform import Rotation

from brrp_cli.cli import main
from brrp_cli.config.planning import RestConfig
from brrp_cli.geometry import similarity, transform_points
from brrp_cli.planning.body import Body, mass_and_inertia
from brrp_cli.planning.mjcf import TableBox
from brrp_cli.planning.parts import hull_corners
from brrp_cli.planning.rest import Rest, put_to_rest

pytest.importorskip("mujoco")
TABLE = TableBox(similarity(translation=np.array([0, 0, -0.01])), np.array([2.0, 2.0, 0.02]))


def body(mesh: trimesh.Trimesh, *place: float, turned=(0.0, 0.0, 0.0), name: str = "a") -> Body:
    """Its centre of mass there, turned by degrees about x, y, z."""
    mesh = mesh.copy()
    mesh.apply_translation(-mesh.center_mass)
    R = Rotation.from_euler("xyz", turned, degrees=True).as_matrix()
    T = similarity(1.0, R, np.array(place))
    mass, inertia = mass_and_inertia(mesh, 500.0)
    parts = [hull_corners(np.asarray(mesh.vertices))]
    return Body(name, T, mesh, mesh, parts, mass, inertia, np.full(3, 0.5))


def box(*size: float) -> trimesh.Trimesh:
    return trimesh.creation.box(size)


def rest(*bodies: Body) -> dict[str, Rest]:
    return put_to_rest({each.name: each for each in bodies}, TABLE, RestConfig())


def lowest(found: Rest) -> float:
    corners = np.vstack([transform_points(found.T_frame_body, part) for part in found.parts])
    return float(corners[:, 2].min())


def still(found: Rest) -> bool:
    return found.left_moved < 0.005 and found.left_turned < 5


def test_neighbours_that_overlap_part_as_little_as_they_need():
    """Two boxes 27 mm in one another: the lighter one moves further, and neither turns."""
    light = body(box(0.06, 0.06, 0.1), 0, 0, 0.05)
    heavy = body(box(0.12, 0.06, 0.1), 0.09 - 0.027, 0, 0.05, name="b")
    found = rest(light, heavy)
    gap = found["b"].T_frame_body[0, 3] - found["a"].T_frame_body[0, 3] - 0.09
    assert abs(gap) < 0.001
    assert found["a"].moved + found["b"].moved == pytest.approx(0.027, abs=0.002)
    assert found["a"].moved == pytest.approx(2 * found["b"].moved, rel=0.1)
    for each in found.values():
        assert each.turned < 1 and each.foot == 0 and still(each)


@pytest.mark.parametrize("height", [0.012, -0.008])
def test_what_hovers_comes_down_and_what_is_sunk_comes_up(height):
    (found,) = rest(body(box(0.05, 0.05, 0.1), 0, 0, 0.05 + height)).values()
    assert lowest(found) == pytest.approx(0, abs=5e-4)
    assert found.moved == pytest.approx(abs(height), abs=5e-4) and found.turned < 0.5
    assert still(found)


def test_a_slanted_one_leans_onto_its_bottom():
    (found,) = rest(body(box(0.06, 0.06, 0.08), 0, 0, 0.042, turned=(2.0, 0, 0))).values()
    assert found.turned == pytest.approx(2, abs=0.3) and found.foot == 0 and still(found)


def test_a_tower_stays_a_tower():
    below, above = body(box(0.1, 0.1, 0.05), 0, 0, 0.025), body(
        box(0.06, 0.06, 0.06), 0.01, 0, 0.05 + 0.03 - 0.004, name="b"
    )  # fmt: skip
    found = rest(below, above)
    assert found["b"].T_frame_body[2, 3] == pytest.approx(0.08, abs=0.001)
    assert all(still(each) and each.moved < 0.006 for each in found.values())


def test_a_bottle_with_a_bump_under_it_gets_a_foot_and_stands():
    """A cone of 4 mm under a tall cylinder, on whose sides it would lean by 8 degrees."""
    bottle = trimesh.creation.cylinder(0.03, 0.2, sections=48)
    tip = trimesh.PointCloud(np.vstack([bottle.vertices, [[0.0, 0.0, -0.104]]])).convex_hull
    (found,) = rest(body(tip, 0, 0, 0.104, turned=(1.0, 0, 0))).values()
    assert found.foot > 0 and found.turned < 3 and found.moved < 0.004 and still(found)
    # Nothing is taken away: what the parts held they still hold.
    low = np.vstack(found.parts)[:, 2].min()
    assert low <= np.vstack(body(tip, 0, 0, 0).parts)[:, 2].min() + 1e-9


def test_what_its_sole_does_not_carry_gets_a_plate():
    """A slab that stands on an edge, 20 degrees from upright."""
    lean = np.deg2rad(20)
    slab = box(0.02, 0.08, 0.16)
    height = 0.08 * np.cos(lean) + 0.01 * np.sin(lean)
    (found,) = rest(body(slab, 0, 0, height, turned=(0, 20.0, 0))).values()
    assert found.plate and found.turned < 3 and found.moved < 0.005 and still(found)


def test_a_ball_stays_where_it_is():
    ball = trimesh.creation.icosphere(3, 0.035)
    (found,) = rest(body(ball, 0, 0, 0.035)).values()
    assert found.moved < 0.005 and still(found)


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Path:
    return write_made_result(tmp_path_factory.mktemp("made") / "out")


def export(results: Path, *options: object) -> tuple[dict, str]:
    arguments = ["export", results, "--collision", "hull", "--overwrite", *options]
    result = CliRunner().invoke(main, [str(each) for each in arguments])
    assert result.exit_code == 0, result.output
    return json.loads((results / "plan" / "plan.json").read_text()), result.output


def test_an_exported_scene_rests_and_tells_what_it_changed(results):
    record, output = export(results)
    assert record["rest"]["friction"] == RestConfig().friction
    for item in record["objects"]:
        told = item["rest"]
        assert told["moved_mm"] < 10 and told["turned_degrees"] < 5
        T, measured = np.array(told["T_frame_body"]), np.array(item["T_frame_body"])
        moved = 1000 * np.linalg.norm(T[:3, 3] - measured[:3, 3])
        assert moved == pytest.approx(told["moved_mm"])
        assert f"put to rest {told['moved_mm']:.1f} mm" in output
    found = stillness(results / "plan")
    assert {item.name for item in found} == {f"object_{BOX}", f"object_{ELL}"}
    for item in found:
        assert item.rests and item.moved < 1 and item.turned < 1 and item.overlap < 0.5
    assert "| made | 2 | 100%" in report({"made": found})


def test_it_rests_in_another_simulator_too(results):
    pytest.importorskip("pybullet")
    export(results)
    found = stillness_in_pybullet(results / "plan")
    assert len(found) == 2
    # Bullet keeps hulls a margin of a millimetre apart.
    assert all(item.rests and item.overlap < 1 for item in found)


def test_without_it_and_with_a_confidence_they_stay_where_they_were_measured(results):
    for options in (["--no-rest"], ["--confidence", 0.9]):
        record, output = export(results, *options)
        assert record["rest"] is None and "put to rest" not in output
        assert all(item["rest"] is None for item in record["objects"])


def test_without_mujoco_it_says_what_to_do(results, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    arguments = ["export", str(results), "--collision", "hull", "-o", str(tmp_path / "plan")]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 1 and "pip install mujoco" in result.output
    assert "--no-rest" in result.output and not (tmp_path / "plan").exists()
    assert CliRunner().invoke(main, [*arguments, "--no-rest"]).exit_code == 0
