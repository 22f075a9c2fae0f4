"""The default preset on a stream: what earlier views of an object at rest bring to later ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh
from box_and_can import can, iou
from table_scene import T_CAM_WORLD, T_WORLD_CAM, box, in_camera, photograph, placed

from brrp_cli import Reconstructor, open_prior, reconstruct
from brrp_cli.geometry import similarity, transform_points, turn_about_z
from brrp_cli.ground_truth.surface_metrics import MeshSurface
from brrp_cli.shapes import solids

BOX, CAN, STRANGE = 9, 4, 6


def gone_round(mesh, turned):
    """A frame of a mesh, in the first camera's frame, from a camera that has gone round the table;
    the same as a table that has turned."""
    around = similarity(rotation=turn_about_z(turned))
    T = T_CAM_WORLD @ around @ T_WORLD_CAM
    frame = photograph({STRANGE: in_camera(mesh, T)})
    return replace(frame, T_world_cam=np.linalg.inv(around) @ T_WORLD_CAM), T


def test_the_first_frame_of_a_stream_is_as_a_frame_alone(box_and_can):
    frame = photograph(
        {
            BOX: in_camera(box(), placed(-0.08, 0.03, 0.7)),
            CAN: in_camera(can(), placed(0.09, -0.04, 0.0)),
        }
    )
    alone = reconstruct(frame, open_prior(box_and_can), workers=2)
    again = Reconstructor(box_and_can, track=True)(frame)
    for a, b in zip(alone.objects, again.objects, strict=True):
        assert a.surface.vertices.tobytes() == b.surface.vertices.tobytes()
        assert a.surface.uncertainty.tobytes() == b.surface.uncertainty.tobytes()
        assert b.memory is None


def test_the_view_of_the_other_side_halves_the_error_of_what_was_not_seen(box_and_can):
    """Of a bar that the prior does not hold: the second view knows what the first one saw."""
    strange = in_camera(solids.box(0.20, 0.05, 0.05), placed(0.0, 0.0, 1.3))
    frames = [gone_round(strange, turned) for turned in (0.0, np.pi)]
    session = Reconstructor(box_and_can, track=True)
    session(frames[0][0])
    both = session(frames[1][0]).objects[0]
    alone = Reconstructor(box_and_can)(frames[1][0]).objects[0]
    # What the second camera alone does not see.
    mesh = in_camera(strange, frames[1][1])
    points, faces = trimesh.sample.sample_surface(mesh, 4000, seed=0)
    hidden = points[np.einsum("ij,ij->i", mesh.face_normals[faces], points) > 0]
    errors = [
        MeshSurface(item.surface.as_trimesh()).nearest(hidden).distance.mean()
        for item in (alone, both)
    ]
    assert errors[1] < errors[0] / 2
    assert both.mean_uncertainty < alone.mean_uncertainty


def test_a_stored_object_starts_from_where_it_was_and_is_found_again_where_it_was_pushed(
    box_and_can,
):
    session, other = (Reconstructor(box_and_can, track=True, workers=n) for n in (1, 2))
    for number, (turned, x) in enumerate([(0.0, 0.09), (0.4, 0.09), (0.6, 0.03)]):
        mesh = in_camera(can(), placed(x, -0.04, 0.0))
        frame, T = gone_round(mesh, turned)
        item, again = session(frame).objects[0], other(frame).objects[0]
        assert item.surface.vertices.tobytes() == again.surface.vertices.tobytes()
        assert item.surface.uncertainty.tobytes() == again.surface.uncertainty.tobytes()
        assert item.recognised.name == "can"
        assert iou(item.surface, in_camera(mesh, T)) > 0.95
        memory = session._tracker._seen[item.object_id]
        assert len(memory) == (1, 2, 1)[number], "what was pushed is forgotten where it was"


def test_poses_that_no_view_tells_apart_are_told_in_later_frames_too(box_and_can):
    """A can without print may be turned about its axis from wherever it is seen."""
    can_at = placed(0.09, -0.04, 0.0)
    session = Reconstructor(box_and_can, track=True)
    for turned in (0.0, 1.2):
        frame, T = gone_round(in_camera(can(), can_at), turned)
        item = session(frame).objects[0]
    assert len(session._tracker._seen[item.object_id]) == 2
    best = item.recognised
    stored = open_prior(box_and_can).load(best.name)
    surface = stored.center + stored.half_extent * stored.surface.astype(np.float64)
    true = MeshSurface(in_camera(can(), T @ can_at))
    assert best.name == "can" and len(best.alike) >= 2
    for T_cam_mesh in (best.T_cam_mesh, *best.alike):
        assert true.nearest(transform_points(T_cam_mesh, surface)).distance.mean() < 0.001
