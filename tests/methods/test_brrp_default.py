"""The default preset from a built prior and a cast frame to shapes whose truth is known."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from box_and_can import can, iou
from sparse_depth import at_the_edge, without_depth
from table_scene import box, in_camera, photograph, placed

from brrp_cli import Reconstructor, open_posterior, open_prior, reconstruct, write_results
from brrp_cli.config import SearchConfig, preset
from brrp_cli.errors import BrrpError, RetrievalError
from brrp_cli.geometry import similarity, transform_points
from brrp_cli.ground_truth.surface_metrics import MeshSurface
from brrp_cli.methods.base import Setup
from brrp_cli.methods.earlier_views import ALONE
from brrp_cli.methods.placements import Placements, Placer
from brrp_cli.methods.scene import look_at
from brrp_cli.observation.ray_samples import without_samples
from brrp_cli.reconstruction import METRES, NO_SURFACE, OK, TOO_FEW_POINTS
from brrp_cli.registration.verification import Verifier
from brrp_cli.retrieval.given import TruthRetriever
from brrp_cli.shapes import solids

BOX, CAN, STRANGE = 9, 4, 6
CONFIG = preset("default")


@pytest.fixture(scope="module")
def truth():
    """True meshes by id, camera frame."""
    return {
        BOX: in_camera(box(), placed(-0.08, 0.03, 0.7)),
        CAN: in_camera(can(), placed(0.09, -0.04, 0.0)),
    }


@pytest.fixture(scope="module")
def result(box_and_can, truth):
    return reconstruct(photograph(truth), open_prior(box_and_can), workers=2)


@pytest.mark.parametrize("object_id", [BOX, CAN])
def test_stored_objects_are_reconstructed_as_they_are(result, truth, object_id):
    item = next(o for o in result.objects if o.object_id == object_id)
    assert item.status == OK and item.surface.as_trimesh().is_watertight
    assert iou(item.surface, truth[object_id]) > 0.95
    assert item.surface.as_trimesh().volume == pytest.approx(truth[object_id].volume, rel=0.03)


def test_the_record_tells_of_evidence_and_weights(result):
    for item, name in zip(result.objects, ("can", "box"), strict=True):
        assert item.retrieved[0].name == name
        assert item.retrieved[0].alignment_score > 0.7
        assert item.retrieved[0].weight > 0.9
        best, other = item.retrieved
        # What is improbable beside an explanation is not placed at all.
        tried = other.probability >= SearchConfig().unlikely * best.probability
        assert (other.alignment_score is not None) == tried
        assert not tried or other.alignment_score < best.alignment_score
        weights = [r.weight for r in item.retrieved]
        assert sum(weights) + item.unknown_weight == pytest.approx(1)
        probabilities = [r.probability for r in item.retrieved]
        assert sum(probabilities) + item.unknown_probability == pytest.approx(1)


def test_the_best_placement_is_the_true_one(result, truth, box_and_can):
    """Points of the stored surface lie on the true one: a can may be turned, a box by halves."""
    stored = open_prior(box_and_can).load("can")
    item = result.objects[0]
    surface = transform_points(item.retrieved[0].T_cam_object, stored.surface.astype(np.float64))
    true = placed(0.09, -0.04, 0.0)
    local = transform_points(np.linalg.inv(true), surface)
    radius, height = np.hypot(*local[:, :2].T), local[:, 2]
    assert radius.max() < 0.045 and height.min() > -0.005 and height.max() < 0.125
    assert item.retrieved[0].size_factor == 1.0


@pytest.mark.parametrize("object_id", [BOX, CAN])
def test_the_pose_of_the_record_is_that_of_the_mesh(result, box_and_can, object_id):
    item = next(o for o in result.objects if o.object_id == object_id)
    best = max(item.retrieved, key=lambda each: each.weight)
    shape = open_prior(box_and_can).load(best.name).shape
    vertices = transform_points(best.T_cam_object, shape.vertices.astype(np.float64))
    off = MeshSurface(item.surface.as_trimesh()).nearest(vertices).distance
    assert off.max() < 0.002


def test_poses_that_the_frame_does_not_tell_apart_are_told(result, box_and_can):
    """A can without print stands as well turned about its axis, and upside down."""
    item = next(o for o in result.objects if o.object_id == CAN)
    best = max(item.retrieved, key=lambda each: each.weight)
    stored = open_prior(box_and_can).load(best.name)
    surface = stored.center + stored.half_extent * stored.surface.astype(np.float64)
    written = MeshSurface(item.surface.as_trimesh())
    assert len(best.alike) >= 2
    for T_cam_mesh in best.alike:
        np.testing.assert_allclose(T_cam_mesh[:3, :3] @ T_cam_mesh[:3, :3].T, np.eye(3), atol=1e-6)
        here, turned = (transform_points(T, surface) for T in (best.T_cam_mesh, T_cam_mesh))
        assert np.linalg.norm(here - turned, axis=1).mean() > 0.005
        assert written.nearest(turned).distance.mean() < 0.001


def test_placements_weigh_what_they_are_worth_in_the_end(box_and_can, truth):
    """Whatever they weighed before they were refined and turned; that of the object stays."""
    prior, frame = open_prior(box_and_can), photograph(truth)
    retriever = Sure([0.5, 0.5])
    scene = look_at(frame, Setup(CONFIG, prior=prior, retriever=retriever), retriever)
    observation = without_samples(scene.frame, BOX)
    points = np.random.default_rng(0).permutation(observation.points).astype(np.float64)
    verifier = Verifier(points, scene.frame, scene.image.plane)
    placer = Placer(scene, observation, verifier, CONFIG.hypotheses, ALONE)
    (best, *_) = placer.placements([("box", 1.0)], {}).placed
    aside = similarity(translation=np.array([0.2, 0.0, 0.0])) @ best.T_cam_model
    both = [replace(best, T_cam_model=aside), best]
    found = Placements([("box", 1.0)], [2], both, [0.0, 0.0], np.array([0.7, 0.2, 0.1]))
    settled = placer.settled(found, np.arange(2))
    assert settled.weights[1] > 0.89
    assert settled.weights[:2].sum() == pytest.approx(0.9) and settled.unknown == 0.1
    alone = placer.settled(found, np.array([1]))
    np.testing.assert_array_equal(alone.weights, found.weights)


def uncertainty(item):
    """Mean on the side that faces the camera, and on the other, metres."""
    mesh = item.surface.as_trimesh()
    towards = np.einsum("ij,ij->i", mesh.vertex_normals, -mesh.vertices) > 0
    return item.surface.uncertainty[towards].mean(), item.surface.uncertainty[~towards].mean()


def test_a_recognised_object_is_known_to_millimetres_on_all_sides(result):
    """What is not seen of it is known as well as what is."""
    item = next(o for o in result.objects if o.object_id == CAN)
    assert item.surface.uncertainty_unit == METRES
    front, back = uncertainty(item)
    assert 0.0005 < front < 0.003
    assert back == pytest.approx(front, rel=0.05)


def test_the_same_seed_gives_the_same_bytes(result, box_and_can, truth):
    again = reconstruct(photograph(truth), open_prior(box_and_can), workers=2)
    for a, b in zip(result.objects, again.objects, strict=True):
        assert a.surface.vertices.tobytes() == b.surface.vertices.tobytes()
        assert a.surface.uncertainty.tobytes() == b.surface.uncertainty.tobytes()


def test_an_object_that_the_prior_does_not_hold_gets_the_shape_of_what_was_seen(box_and_can):
    """A lying bar, of a shape that nothing stored comes near."""
    strange = in_camera(solids.box(0.20, 0.05, 0.05), placed(0.0, 0.0, 1.3))
    found = reconstruct(photograph({STRANGE: strange}), open_prior(box_and_can)).objects[0]
    assert found.unknown_weight > 0.5
    front, back = uncertainty(found)
    assert 0.0005 < front < back < 0.05, "less is known of what nobody saw"
    assert iou(found.surface, strange) > 0.6


@pytest.mark.parametrize("stream", [False, True])
def test_a_stored_object_with_hardly_any_depth_is_placed_by_its_mask(box_and_can, truth, stream):
    """Eight points at the edge of its mask, and those are 2 cm too far away."""
    frame, prior = at_the_edge(photograph(truth), BOX, 8, 0.02), open_prior(box_and_can)
    if stream:
        with Reconstructor(prior, workers=1, track=True) as session:
            found = session(frame)
    else:
        found = reconstruct(frame, prior)
    item = next(each for each in found.objects if each.object_id == BOX)
    assert item.status == OK and item.n_points == 8
    assert max(item.retrieved, key=lambda each: each.weight).name == "box"
    assert iou(item.surface, truth[BOX]) > 0.85
    assert item.surface.uncertainty.mean() > 0.003, "where it stands is supposed, not seen"


def test_no_shape_is_made_of_a_few_points_of_what_the_prior_does_not_hold(box_and_can):
    strange = in_camera(solids.box(0.20, 0.05, 0.05), placed(0.0, 0.0, 1.3))
    frame = at_the_edge(photograph({STRANGE: strange}), STRANGE, 8, 0.0)
    found = reconstruct(frame, open_prior(box_and_can)).objects[0]
    assert found.status == TOO_FEW_POINTS and found.surface is None
    assert "8 valid depth points, 16 are needed" in found.message
    nothing = reconstruct(without_depth(frame, STRANGE), open_prior(box_and_can)).objects[0]
    assert (nothing.status, nothing.n_points) == (TOO_FEW_POINTS, 0)


def test_retrieval_that_is_wrong_is_outweighed_by_what_the_frame_says(box_and_can, truth):
    prior = open_prior(box_and_can)
    wrong = TruthRetriever(prior.names, {CAN: "box"})
    found = reconstruct(photograph({CAN: truth[CAN]}), prior, retriever=wrong).objects[0]
    weights = {r.name: r.weight for r in found.retrieved}
    assert [r.name for r in found.retrieved] == ["box", "can"]
    assert weights["can"] > 0.9
    assert iou(found.surface, truth[CAN]) > 0.85


def test_a_retriever_may_be_named(box_and_can, truth):
    frame, prior = photograph({CAN: truth[CAN]}), open_prior(box_and_can)
    found = reconstruct(frame, prior, retriever="uniform")
    assert found.retriever == "uniform"
    shares = [each.probability for each in found.objects[0].retrieved]
    assert shares == pytest.approx([1 / len(prior.names)] * len(shares))
    with pytest.raises(RetrievalError, match="No such retriever"):
        reconstruct(frame, prior, retriever="telepathy")
    with pytest.raises(BrrpError, match="uses no retriever"):
        reconstruct(frame, method="vprism", retriever="uniform")


class Sure:
    """The same P(c|R) of every object."""

    name = "sure"

    def __init__(self, shares):
        self.shares = np.array(shares)

    def probabilities(self, frame, object_id):
        return self.shares


def test_objects_share_the_time_of_retrieval_equally(box_and_can, truth):
    """The first answer is the work of all."""

    class Slow:
        name = "slow"
        answered = False

        def probabilities(self, frame, object_id):
            if not self.answered:
                time.sleep(0.4)
            self.answered = True
            return np.array([0.5, 0.5])

    found = reconstruct(photograph(truth), open_prior(box_and_can), retriever=Slow(), workers=2)
    shares = [item.seconds["retrieval"] for item in found.objects]
    assert shares[0] == shares[1] and sum(shares) >= 0.4


def test_what_is_improbable_beside_an_explanation_is_not_placed(box_and_can, truth):
    prior = open_prior(box_and_can)
    sure = Sure([0.9 if name == "can" else 0.04 for name in prior.names])
    found = reconstruct(photograph({CAN: truth[CAN]}), prior, retriever=sure).objects[0]
    can, other = found.retrieved
    assert can.weight > 0.9 and can.alignment_score >= SearchConfig().explained
    assert other.name == "box" and other.weight == 0 and other.T_cam_object is None
    assert can.weight + found.unknown_weight == pytest.approx(1)


def test_what_is_not_tried_counts_as_not_in_the_prior(box_and_can, truth):
    """However much of P(c|R) is with objects beyond the first k, the others gain nothing by it."""
    prior = open_prior(box_and_can)
    weights = []
    for rest in (0.05, 0.0):
        sure = Sure([0.1 if name == "can" else rest for name in prior.names])
        frame, few = photograph({CAN: truth[CAN]}), replace(CONFIG, k=1)
        found = reconstruct(frame, prior, retriever=sure, config=few).objects[0]
        assert found.unknown_probability == pytest.approx(1 - sure.shares.sum())
        weights.append(found.retrieved[0].weight)
    assert 0 < weights[0] == pytest.approx(weights[1])


def test_a_map_that_is_nowhere_sure_enough_has_no_surface_but_files(box_and_can, truth, tmp_path):
    config = replace(CONFIG, surface=replace(CONFIG.surface, level=0.99999))
    result = reconstruct(photograph({CAN: truth[CAN]}), open_prior(box_and_can), config=config)
    assert result.objects[0].status == NO_SURFACE
    names = {path.name for path in write_results(result, tmp_path / "out")}
    assert names == {"frame.npz", "posterior.h5", "result.json", "preview.png"}
    assert list(open_posterior(tmp_path / "out" / "posterior.h5")) == [CAN]


def test_without_a_table_in_sight_there_is_a_result_too(box_and_can, truth):
    frame = photograph({CAN: truth[CAN]}, table=False)
    found = reconstruct(frame, open_prior(box_and_can))
    assert found.plane is None
    assert iou(found.objects[0].surface, truth[CAN]) > 0.7


def test_the_number_of_threads_changes_no_byte(box_and_can, truth, result):
    again = reconstruct(photograph(truth), open_prior(box_and_can), workers=1)
    for one, other in zip(result.objects, again.objects, strict=True):
        assert one.surface.vertices.tobytes() == other.surface.vertices.tobytes()
        assert one.surface.uncertainty.tobytes() == other.surface.uncertainty.tobytes()
