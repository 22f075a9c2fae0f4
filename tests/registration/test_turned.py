"""What looks almost alike when it is turned: the pixels choose, and what they cannot is kept."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation
from table_scene import MESHES, TABLE, in_camera, photograph, placed, stored

from brrp_cli.config import SearchConfig
from brrp_cli.geometry import similarity
from brrp_cli.registration.model import search_model
from brrp_cli.registration.pose_search import Hypothesis
from brrp_cli.registration.turned import turned
from brrp_cli.registration.verification import Verifier

CONFIG, PATCH = SearchConfig(), 0.01


def seen(name, noise=0.0005):
    """The model, where it stands, and what the camera sees of it, with noise along the rays."""
    model = search_model(stored(name))
    T_cam_mesh = placed(0.0, 0.0, 0.4)
    frame = photograph({1: in_camera(MESHES[name](), T_cam_mesh)})
    rng = np.random.default_rng(0)
    points = rng.permutation(frame.object_points(1)).astype(np.float64)
    points *= 1 + noise * rng.normal(size=(len(points), 1))
    truth = T_cam_mesh @ similarity(translation=model.stored.center)
    return model, truth, Verifier(points, frame, TABLE)


def apart(T, truth):
    """Radians between two placements."""
    return Rotation.from_matrix((np.linalg.inv(truth) @ T)[:3, :3]).magnitude()


def test_a_fruit_is_turned_to_where_its_dents_were_seen():
    model, truth, verifier = seen("fruit")
    wrong = truth @ similarity(rotation=Rotation.from_rotvec([0, 0, 2.0]).as_matrix())
    found = turned(Hypothesis(model, wrong, 1.0, 0.9), verifier, PATCH, CONFIG)
    assert apart(found.best.T_cam_model, truth) < 0.1 < apart(wrong, truth)
    assert found.best.alignment_score == 0.9
    assert not len(found.alike), "what was seen tells the others apart"


def test_what_fits_stays_as_it_is():
    model, truth, verifier = seen("fruit")
    right = Hypothesis(model, truth, 1.0, 0.9)
    assert turned(right, verifier, PATCH, CONFIG).best is right


def test_nothing_is_like_an_ell():
    model, truth, verifier = seen("ell")
    right = Hypothesis(model, truth, 1.0, 0.9)
    found = turned(right, verifier, PATCH, CONFIG)
    assert found.best is right and found.alike.shape == (0, 4, 4)


def test_a_box_may_as_well_stand_back_to_front():
    model, truth, verifier = seen("box")
    found = turned(Hypothesis(model, truth, 1.0, 0.9), verifier, PATCH, CONFIG)
    angles = np.array([apart(T, found.best.T_cam_model) for T in found.alike])
    assert len(angles) and (angles > 3.0).all()
