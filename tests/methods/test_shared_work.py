"""Work is done here or by a helper, whoever is free, with the same results."""

from __future__ import annotations

import errno
import os
import tempfile
import threading
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace

import for_helpers
import pytest
from for_helpers import Common
from painted_retrieval import write_coarse
from table_scene import box, in_camera, photograph, placed

from brrp_cli import Reconstructor, load_config, open_prior
from brrp_cli.config import FeatureConfig
from brrp_cli.errors import PriorError
from brrp_cli.methods.registry import METHODS
from brrp_cli.methods.shared_work import MOST, shared_work, started_later
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.parameters import AppearanceConfig, BuildParameters
from brrp_cli.shapes import solids
from brrp_cli.threads import in_threads


@pytest.fixture(scope="module")
def prior(tmp_path_factory):
    meshes = tmp_path_factory.mktemp("meshes")
    box().export(meshes / "box.ply")
    solids.cylinder(0.04, 0.12).export(meshes / "can.ply")
    out = tmp_path_factory.mktemp("prior") / "prior"
    looks = AppearanceConfig(views=8, rays=500)
    parameters = BuildParameters(
        samples=1000, dense_points=5000, features=FeatureConfig(scales=(1.0,)), appearance=looks
    )
    build_prior(meshes, out, parameters, workers=1)
    return open_prior(out)


@pytest.fixture(scope="module")
def frame():
    can = solids.cylinder(0.04, 0.12)
    return photograph(
        {
            9: in_camera(box(), placed(-0.08, 0.03, 0.7)),
            4: in_camera(can, placed(0.09, -0.04, 0.0)),
            6: in_camera(solids.box(0.03, 0.05, 0.04), placed(0.0, 0.12, 0.3)),
        }
    )


@pytest.fixture
def common(prior, frame):
    image = SimpleNamespace(plane=None, noise=None)
    scene = SimpleNamespace(frame=frame, image=image, prior=prior, device="cpu")
    return Common(scene, os.getpid())


@contextmanager
def one_helper():
    found = started_later(METHODS["brrp"], 2, None)
    found.start()
    found.wait()
    assert found.any_ready
    yield found
    found.close()


@pytest.fixture(scope="module")
def helpers():
    """For all tests that it outlives."""
    with one_helper() as found:
        yield found


def test_who_is_free_does_it(common, helpers, frame):
    """The frame that comes back is the one that went."""
    both = threading.Barrier(2, timeout=60)

    def work_of(number):
        both.wait()
        return do("work", number)

    with shared_work(for_helpers.here_or_there, common, common.scene, helpers) as do:
        for turn in range(3):
            found = list(in_threads(work_of, [2 * turn, 2 * turn + 1], 2))
            assert [number for _, number, _ in found] == [2 * turn, 2 * turn + 1]
            assert all(seen is frame for _, _, seen in found)
        with helpers.lent():
            assert do("work", 7)[0] is False, "it is busy"
        assert do("work", 8)[0] is True


def test_what_a_helper_dies_of_is_done_here(common):
    with (
        one_helper() as mortal,
        shared_work(for_helpers.here_or_there, common, common.scene, mortal) as do,
    ):
        assert do("die", 3)[:2] == (False, 3)
        assert do("work", 4)[:2] == (False, 4), "it is gone"


def test_a_helper_that_cannot_open_the_prior_leaves_the_work_here(common, helpers, prior):
    """It was built again meanwhile; who has opened it before goes on."""
    changed = replace(prior, index=replace(prior.index, digest="0" * 64))
    scene = SimpleNamespace(**{**vars(common.scene), "prior": changed})
    there = replace(common, scene=scene)
    with shared_work(for_helpers.here_or_there, there, scene, helpers) as do:
        assert do("work", 5)[:2] == (False, 5)
    with shared_work(for_helpers.here_or_there, common, common.scene, helpers) as do:
        assert do("work", 6)[:2] == (True, 6)


def test_without_room_for_what_is_shared_the_work_is_done_here(common, helpers, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(tempfile, "NamedTemporaryFile", full)
    with shared_work(for_helpers.here_or_there, common, common.scene, helpers) as do:
        assert do("work", 5)[:2] == (False, 5)


def test_errors_are_those_of_the_work(common, helpers):
    with shared_work(for_helpers.here_or_there, common, common.scene, helpers) as do:
        with pytest.raises(PriorError, match="damaged"):
            do("fail", 0)
        assert do("work", 1)[0] is True


@pytest.mark.parametrize(
    ("method", "workers", "count"), [("brrp", 1, 0), ("vprism", 4, 0), ("brrp", 64, MOST)]
)
def test_only_a_method_that_gains_by_it_has_helpers(method, workers, count):
    assert started_later(METHODS[method], workers, None).count == count


def test_a_session_with_helpers_has_the_bytes_of_one_without(prior, frame, tmp_path):
    bare, config = frame.without_masks(), load_config(write_coarse(tmp_path))
    with (
        Reconstructor(prior, config=config, workers=1) as alone,
        Reconstructor(prior, config=config, workers=2) as session,
    ):
        assert not session.helpers.any_ready
        for seen in (frame, frame, bare):
            expected, found = alone(seen), session(seen)
            session.helpers.wait()
            assert session.helpers.any_ready and not alone.helpers.any_ready
            assert [item.row() for item in found.objects] == [
                item.row() for item in expected.objects
            ]
            for a, b in zip(expected.objects, found.objects, strict=True):
                assert a.surface.vertices.tobytes() == b.surface.vertices.tobytes()
                assert a.surface.uncertainty.tobytes() == b.surface.uncertainty.tobytes()
                assert a.seconds.keys() == b.seconds.keys()
    assert not session.helpers.any_ready
