"""Grasps of shapes whose grasps are known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from made_result import posterior_on

from brrp_cli.config import SurfaceConfig
from brrp_cli.config.grasping import GraspConfig
from brrp_cli.errors import BrrpError
from brrp_cli.grasping.closing import Closed, close_on
from brrp_cli.grasping.draws import Mesh, draw_surfaces, mesh_alone
from brrp_cli.grasping.gripper_file import open_gripper
from brrp_cli.grasping.hidden_space import NOTHING_HIDDEN
from brrp_cli.grasping.obstacles import Obstacles
from brrp_cli.grasping.plan import NOWHERE, plan_grasps, why_below, why_none
from brrp_cli.grasping.scene import GraspObject, GraspScene
from brrp_cli.observation.support_plane import Plane
from brrp_cli.physics import GRAVITY
from brrp_cli.raycast import raycasting_scene
from brrp_cli.shapes import solids

FRANKA = open_gripper("franka-hand")
TABLE = Plane(np.array([0.0, 0.0, 1.0]), 0.0)
NOTHING = np.zeros((0, 3))


def thing(mesh: trimesh.Trimesh, object_id: int = 1, posterior=None) -> GraspObject:
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64)
    return GraspObject(object_id, vertices, faces, vertices, posterior)


def scene(*objects: GraspObject, plane: Plane | None = TABLE, loose=NOTHING) -> GraspScene:
    return GraspScene(list(objects), plane, {}, loose, SurfaceConfig())


def grasps(*objects: GraspObject, plane: Plane | None = TABLE, loose=NOTHING, **options):
    """Of the first object, which weighs nothing unless `config` says so."""
    options.setdefault("config", GraspConfig(density=0.0, lightest=0.0))
    plan = plan_grasps(scene(*objects, plane=plane, loose=loose), FRANKA, workers=1, **options)
    return next(each for each in plan.objects if each.object_id == objects[0].object_id)


def axes(found) -> np.ndarray:
    """(n, 3, 3) columns x, y, z of each hand."""
    return np.stack([grasp.T_cam_gripper[:3, :3] for grasp in found.grasps])


def test_a_box_is_held_across_the_side_that_fits():
    found = grasps(thing(solids.box(0.12, 0.06, 0.10)))
    assert len(found.grasps) >= 10
    across = np.abs(axes(found)[:, 1, 0])
    assert across.min() > np.cos(np.arctan(0.5))
    for grasp in found.grasps:
        assert grasp.score > 0.9
        assert grasp.width == pytest.approx(0.06, abs=0.004)
        np.testing.assert_allclose(np.sort(grasp.contacts[:, 1]), [-0.03, 0.03], atol=1e-3)
        # The contacts lie between the fingers, the left one's towards -x.
        local = (grasp.contacts - grasp.T_cam_gripper[:3, 3]) @ grasp.T_cam_gripper[:3, :3]
        assert local[0, 0] < 0 < local[1, 0]
        assert (local[:, 2] > FRANKA.palm_length).all() and (local[:, 2] < FRANKA.tip).all()


def test_what_is_wider_than_the_hand_has_none():
    ball = trimesh.creation.icosphere(3, 0.05).apply_translation([0, 0, 0.05])
    found = grasps(thing(ball))
    assert found.grasps == []
    assert found.fell["too_wide"] == found.fell["points"]
    assert "opening" in found.why
    smaller = trimesh.creation.icosphere(3, 0.03).apply_translation([0, 0, 0.03])
    assert grasps(thing(smaller)).grasps


def test_what_is_too_heavy_falls_by_its_weight():
    found = grasps(thing(solids.box(0.05, 0.05, 0.12)), config=GraspConfig(density=1e8))
    assert found.grasps == [] and found.fell["weight"] > found.fell["object"]
    assert "its weight" in found.why


def test_what_min_score_alone_left_out_is_told_so():
    """The score of a grasp of a low box that a robot may miss by a millimetre is below 1."""
    low = thing(solids.box(0.04, 0.1, 0.012))
    near = GraspConfig(table_gap=0.001, density=0.0, lightest=0.0)
    best = max(grasp.score for grasp in grasps(low, config=near, per_object=200).grasps)
    assert 0.5 < best < 1.0
    found = grasps(low, config=near, min_score=1.0)
    shown = math.floor(best * 100) / 100
    assert found.grasps == []
    assert found.why == f"its best grasp holds with probability {shown:.2f}, less than min_score=1"
    # What a neighbour is in the way of as well is no grasp that was left out.
    wall = thing(solids.moved(solids.box(0.3, 0.3, 0.011), x=0.0, z=0.015), 2)
    under = grasps(low, wall, config=near, min_score=1.0)
    assert under.grasps == [] and "min_score" not in under.why


def test_where_the_best_grasp_mostly_fails_it_is_also_told_why():
    fell = {"friction": 7, "object": 2}
    assert why_below(0.9599, "--min-score 0.96", fell).endswith("0.95, less than --min-score 0.96")
    told = why_below(0.124, "--min-score 0.3", fell)
    assert told.endswith("0.12, less than --min-score 0.3: mostly it would slip out")


def test_what_has_no_surface_falls_for_no_other_reason():
    assert why_none({"points": 0, "too_wide": 0, "not_antipodal": 0}) == NOWHERE
    assert "opening" in why_none({"points": 9, "too_wide": 5, "not_antipodal": 4})


def test_hands_stay_above_the_table():
    found = grasps(thing(solids.box(0.10, 0.04, 0.03)))
    assert found.grasps
    for grasp in found.grasps:
        lowest = FRANKA.lowest(grasp.T_cam_gripper[None], np.array([grasp.opening]), TABLE)
        assert lowest[0] > GraspConfig.table_gap - 1e-6
    flat = grasps(thing(solids.box(0.10, 0.10, 0.004)))
    assert flat.grasps == [] and flat.why


def test_a_robot_that_misses_its_pose_may_touch_the_table_beside_what_lies_low():
    """By a millimetre, where the fingers end as much over it."""
    low, tall = (thing(solids.box(0.04, 0.1, height)) for height in (0.012, 0.1))
    sure = GraspConfig(table_gap=0.001, accuracy=0.0, accuracy_angle=0.0, density=0.0, lightest=0.0)
    assert grasps(low, config=sure).grasps[0].score == 1.0
    near = GraspConfig(table_gap=0.001, density=0.0, lightest=0.0)
    assert 0.5 < grasps(low, config=near).grasps[0].score < 1.0
    assert grasps(tall, config=near).grasps[0].score == 1.0


def test_top_down_comes_from_above_and_a_cone_from_around_it():
    box = thing(solids.box(0.05, 0.05, 0.12))
    down = axes(grasps(box, approach="top-down", per_object=100))[:, 2, 2]
    cone = axes(grasps(box, approach="cone", per_object=100))[:, 2, 2]
    every = axes(grasps(box, per_object=100))[:, 2, 2]
    assert down.max() <= -np.cos(np.deg2rad(15)) + 1e-6
    assert cone.max() <= -np.cos(np.deg2rad(45)) + 1e-6
    assert every.max() > -0.5  # from the side as well


def test_a_neighbour_takes_the_side_that_it_blocks():
    tall = thing(solids.box(0.05, 0.05, 0.16))
    wall = thing(solids.moved(solids.box(0.02, 0.4, 0.4), x=0.06), 2)
    behind = thing(solids.moved(solids.box(0.02, 0.4, 0.4), x=-0.5), 3)
    from_wall = axes(grasps(tall, behind, per_object=200))[:, 0, 2]
    assert (from_wall < -0.7).any() and (from_wall > 0.7).any()
    blocked = grasps(tall, wall, per_object=200)
    assert blocked.grasps and blocked.fell["neighbour"] > 0
    assert axes(blocked)[:, 0, 2].min() > -0.5
    # The points of what has no mesh are kept out of as well.
    y, z = np.meshgrid(np.linspace(-0.2, 0.2, 40), np.linspace(0, 0.4, 40))
    loose = np.column_stack([np.full(y.size, 0.05), y.ravel(), z.ravel()])
    assert axes(grasps(tall, loose=loose, per_object=200))[:, 0, 2].min() > -0.5


def test_what_rays_miss_is_found_exactly():
    """A needle between the rays of a hand that comes straight down."""
    needle = trimesh.creation.box((0.0004, 0.0004, 0.05)).apply_translation([0.033, 0.003, 0.02])
    around = Obstacles(
        [Mesh(np.asarray(needle.vertices), np.asarray(needle.faces))], NOTHING, NOTHING_HIDDEN
    )
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[2, 3] = FRANKA.tip + 0.005
    config = GraspConfig()
    assert not around.probably_hits(T[None], np.array([0.06]), FRANKA, config)[0]
    assert around.hits(T, 0.06, FRANKA, config)
    assert not around.hits(T, 0.07, FRANKA, config)  # it passes inside the finger
    T[0, 3] = 0.5
    assert not around.hits(T, 0.06, FRANKA, config)


def closed_on_a_wedge(lean: float, friction: float) -> Closed:
    """On sides that lean by so many degrees."""
    block = solids.box(0.01, 0.04, 0.06)
    vertices = np.asarray(block.vertices).copy()
    vertices[:, 0] += np.sign(vertices[:, 0]) * (0.06 - vertices[:, 2]) * np.tan(np.deg2rad(lean))
    wedge = Mesh(vertices, np.asarray(block.faces, dtype=np.int64))
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[2, 3] = FRANKA.tip + 0.035
    config = GraspConfig(friction=friction)
    return close_on(mesh_alone(wedge), T[None], np.array([0.08]), FRANKA, config)


@pytest.mark.parametrize(("lean", "friction"), [(20, 0.5), (35, 0.5), (35, 0.9), (50, 0.9)])
def test_a_wedge_holds_surely_within_the_friction_cone_and_less_outside(lean, friction):
    found = closed_on_a_wedge(lean, friction)
    assert found.margin[0, 0] == pytest.approx(np.cos(np.deg2rad(lean)), abs=1e-3)
    edge = np.cos(np.arctan(friction))
    outside = max(0.0, 1 - np.cos(np.deg2rad(lean)) / edge)
    expected = 1 - (1 - GraspConfig.askew) * outside
    assert found.holds[0, 0] == pytest.approx(expected, abs=2e-3)
    assert found.slips[0, 0] == pytest.approx(1 - expected, abs=2e-3)


def test_a_finger_that_grazes_a_box_pushes_it_aside():
    """The left finger comes down over the edge of a box by so much."""
    box = trimesh.creation.box((0.05, 0.04, 0.06))
    mesh = Mesh(np.asarray(box.vertices), np.asarray(box.faces, dtype=np.int64))
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[2, 3] = FRANKA.tip + 0.01
    config = GraspConfig()
    for over, held in ((0.8 * config.grazes, True), (1.2 * config.grazes, False)):
        T[0, 3] = 0.005 + over
        found = close_on(mesh_alone(mesh), T[None], np.array([0.06]), FRANKA, config)
        assert bool(found.collides[0, 0]) != held
        assert found.holds[0, 0] == pytest.approx(float(held))


def uncertain(width: float) -> GraspObject:
    """A box 66 mm wide whose surface's place is logistic with that scale, metres."""
    box = solids.box(0.10, 0.066, 0.10)
    exact = raycasting_scene([box])

    def logit(points: np.ndarray) -> np.ndarray:
        return -exact.compute_signed_distance(points.astype(np.float32), nsamples=3).numpy() / width

    bounds = np.asarray(box.bounds) + np.array([[-0.03], [0.03]])
    return thing(box, posterior=posterior_on([logit], bounds, which=(0, 0)))


def test_the_score_falls_as_the_posterior_spreads():
    options = {"min_score": 0.0, "config": GraspConfig(confidence=0.0, density=0.0, lightest=0.0)}
    means = []
    for width in (0.0005, 0.003, 0.01):
        found = grasps(uncertain(width), **options)
        means.append(np.mean([grasp.score for grasp in found.grasps]))
    assert means[0] > 0.9
    assert means[0] > means[1] + 0.05 and means[1] > means[2] + 0.05


def test_particles_that_disagree_about_the_back_count_by_their_share():
    """A quarter of the particles knows a box that is too wide for the hand."""
    narrow, wide = solids.box(0.10, 0.05, 0.10), solids.box(0.10, 0.12, 0.10)

    def of(mesh):
        exact = raycasting_scene([mesh])

        def logit(points):
            hit = exact.compute_signed_distance(points.astype(np.float32), nsamples=3).numpy()
            return -hit / 0.0005

        return logit

    bounds = np.asarray(wide.bounds) + np.array([[-0.02], [0.02]])
    posterior = posterior_on([of(narrow), of(wide)], bounds, which=(0, 0, 0, 1))
    found = grasps(thing(narrow, posterior=posterior), min_score=0.0)
    best = [grasp.score for grasp in found.grasps[:5]]
    assert best == pytest.approx([0.75] * 5, abs=0.09)


def test_an_object_that_may_not_be_there_is_drawn_as_nothing():
    box = solids.box(0.05, 0.05, 0.10)
    posterior = posterior_on(
        [lambda p: np.where((np.abs(p[:, :2]) < 0.025).all(axis=1), 0.0, -8.0)],
        np.asarray(box.bounds) + np.array([[-0.02], [0.02]]),
    )
    rng = np.random.default_rng(0)
    item = thing(box, posterior=posterior)
    own = Mesh(item.vertices, item.faces)
    drawn = draw_surfaces(item, own, GraspConfig(), SurfaceConfig(), rng)
    assert (drawn.which < 0).mean() == pytest.approx(0.5, abs=0.1)


def test_the_same_seed_gives_the_same_grasps_on_any_number_of_workers():
    items = (
        thing(solids.box(0.12, 0.06, 0.10)),
        thing(solids.moved(solids.box(0.05, 0.05, 0.1), x=0.3), 2),
    )
    plans = [plan_grasps(scene(*items), FRANKA, seed=3, workers=n).grasps for n in (1, 2)]
    for one, two in zip(*plans, strict=True):
        assert np.array_equal(one.T_cam_gripper, two.T_cam_gripper) and one.score == two.score
    other = plan_grasps(scene(*items), FRANKA, seed=4, workers=1).grasps
    assert not np.array_equal(other[0].T_cam_gripper, plans[0][0].T_cam_gripper)


def test_kept_grasps_differ():
    found = grasps(thing(solids.box(0.12, 0.06, 0.10)), per_object=50)
    tips = [g.T_cam_gripper @ [0, 0, FRANKA.tip, 1] for g in found.grasps]
    for i, one in enumerate(found.grasps):
        for j in range(i):
            near = np.linalg.norm(tips[i] - tips[j]) < 0.0099
            turned = one.T_cam_gripper[:3, 2] @ found.grasps[j].T_cam_gripper[:3, 2]
            spun = abs(one.T_cam_gripper[:3, 0] @ found.grasps[j].T_cam_gripper[:3, 0])
            assert not (near and min(turned, spun) > np.cos(np.deg2rad(19.9)))


def test_an_approach_that_is_none_is_told():
    with pytest.raises(BrrpError, match="No such approach"):
        grasps(thing(solids.box(0.05, 0.05, 0.05)), approach="sideways")


def test_a_heavy_thing_is_held_near_its_middle():
    """Grasps of a long bar, sure but for its weight."""
    bar = solids.box(0.3, 0.04, 0.04)
    exact = {"accuracy": 0.0, "accuracy_angle": 0.0}
    config = GraspConfig(density=2_000.0, **exact)
    found = grasps(thing(bar), config=config, min_score=0.0, per_object=200)
    mass = 2_000.0 * bar.volume
    levers, shares = [], []
    for grasp in found.grasps:
        x, middle = grasp.T_cam_gripper[:3, 0], grasp.contacts.mean(axis=0)
        levers.append(np.linalg.norm(np.cross(bar.center_mass - middle, x)))
        likely = np.exp(-mass * GRAVITY * levers[-1] / config.torque)
        shares.append(grasp.score / likely)
    # Hands that take an edge may slip besides.
    assert max(shares) < 1 + 1e-6 and np.median(shares) == pytest.approx(1)
    assert max(levers) > 0.1 and min(levers) < 0.02
    # The first ones are those.
    assert np.mean(levers[:5]) < 0.04
    light = grasps(thing(bar), config=replace(config, density=0.0, lightest=0.0), per_object=200)
    assert np.median([grasp.score for grasp in light.grasps]) == 1
