"""BOP's results file: rigid poses of the objects' own mesh files, millimetres."""

import csv
import io
from pathlib import Path

import numpy as np
import pytest

from brrp_cli.geometry import similarity
from brrp_cli.results.bop import bop_csv, bop_id, image_ids, numbers_image
from brrp_cli.results.write import result_record


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("obj_000012", 12),
        ("003_cracker_box", 2),
        ("061_foam_brick", 21),
        ("mug", 3),
        ("024_bowl", 13),
    ],
)
def test_numbers_of_objects(name: str, number: int) -> None:
    assert bop_id(name, ["bowl", "can", "mug"]) == number


def test_scene_and_image_come_from_the_path() -> None:
    assert image_ids(Path("ycbv/test/000048/rgb/000001.png")) == (48, 1)
    assert image_ids(Path("frame.npz")) == (0, 0) and image_ids(None) == (0, 0)


@pytest.mark.parametrize(
    ("source", "numbered"),
    [
        ("ycbv/test/000048/000000", True),
        ("scene_0007/rgb/0003.png", True),
        ("2024/frames/f1.npz", False),
        ("f1.npz", False),
    ],
)
def test_whether_a_frame_s_own_name_numbers_its_image(source: str, numbered: bool) -> None:
    assert numbers_image(Path(source)) is numbered
    assert not numbers_image(None)


def test_a_row_for_each_recognised_object(made_reconstruction) -> None:
    rows = list(
        csv.DictReader(
            io.StringIO(bop_csv(result_record(made_reconstruction, "camera"), ["can", "mug"]))
        )
    )
    assert [row["obj_id"] for row in rows] == ["2"]
    R = np.array(rows[0]["R"].split(), dtype=float).reshape(3, 3)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-6)
    np.testing.assert_allclose(np.array(rows[0]["t"].split(), dtype=float), [100, -200, 900])
    assert float(rows[0]["score"]) == pytest.approx(0.9)


@pytest.fixture
def made_reconstruction():
    from brrp_cli.frames.frame import Frame
    from brrp_cli.reconstruction import OK, ObjectReconstruction, Reconstruction, Retrieved

    frame = Frame(
        rgb=np.zeros((4, 4, 3), np.uint8),
        points=np.ones((4, 4, 3), np.float32),
        segmap=np.ones((4, 4), np.int64),
        K=np.eye(3),
    )
    T = similarity(translation=np.array([0.1, -0.2, 0.9]))
    taken = Retrieved("mug", 0.8, T, T, 1.0, weight=0.9)
    doubted = Retrieved("can", 0.3, T, T, 1.0, weight=0.4)
    return Reconstruction(
        frame=frame,
        objects=[
            ObjectReconstruction(1, OK, retrieved=[doubted, taken]),
            ObjectReconstruction(2, OK, retrieved=[doubted]),
        ],
        plane=None,
        method="brrp",
        retriever="appearance",
        prior_path=None,
        prior_digest=None,
        configuration={},
        seed=0,
        device="cpu",
    )
