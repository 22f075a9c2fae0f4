"""Objects of which little, or too much, is seen: each gets a status or a sane mesh, and the others
are written all the same."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from table_scene import MESHES, SHAPE, K, photograph, placed

from brrp_cli import open_prior, reconstruct
from brrp_cli.errors import OutputError
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.frame import Frame
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.parameters import AppearanceConfig, BuildParameters
from brrp_cli.reconstruction import Reconstruction
from brrp_cli.results.write import write_results

BOX = 1


@pytest.fixture(scope="module")
def prior(tmp_path_factory: pytest.TempPathFactory) -> Path:
    meshes = tmp_path_factory.mktemp("meshes")
    MESHES["box"]().export(meshes / "box.ply")
    out = tmp_path_factory.mktemp("prior") / "prior"
    looks = AppearanceConfig(views=8, rays=500)
    parameters = BuildParameters(
        samples=1000, surface_points=500, dense_points=5000, appearance=looks
    )
    build_prior(meshes, out, parameters, workers=1)
    return out


@pytest.fixture(scope="module")
def seen() -> Frame:
    """A box on the table."""
    mesh = MESHES["box"]().copy().apply_transform(placed(0.0, 0.0, 0.5))
    return photograph({BOX: mesh})


def with_mask(seen: Frame, region, depth=None) -> Frame:
    """The same with one more object where the table is; `depth` replaces what was measured."""
    mask, z = seen.segmap.copy(), seen.points[..., 2].copy()
    mask[region] = 2
    if depth is not None:
        z[region] = depth
    return make_frame(rgb=seen.rgb, segmap=mask, depth=z, K=K, T_world_cam=seen.T_world_cam)


ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]]
CHECKS = (ROWS + COLUMNS) % 2 == 0
PATCH = np.s_[190:215, 30:70]
BORDER = (ROWS < 3) | (ROWS > 236) | (COLUMNS < 3) | (COLUMNS > 316)

CASES = {
    "one pixel": lambda s: with_mask(s, np.s_[200:201, 40:41]),
    "a line": lambda s: with_mask(s, np.s_[210, 20:60]),
    "flat on the table": lambda s: with_mask(s, PATCH),
    "no depth at all": lambda s: with_mask(s, PATCH, np.nan),
    "every other pixel without depth": lambda s: with_mask(
        s, PATCH, np.where(CHECKS, s.points[..., 2], np.nan)[PATCH]
    ),
    "at the image's border": lambda s: with_mask(s, np.s_[200:, :40], 0.5),
    "all of the border": lambda s: with_mask(s, BORDER & (s.segmap == 0)),
    "points on one ray": lambda s: with_mask(s, np.s_[200:204, 40:44], 0.4),
    "a few stray depths of 90 m": lambda s: with_mask(s, PATCH, np.where(CHECKS[PATCH], 0.5, 90.0)),
    "right before the camera": lambda s: with_mask(s, np.s_[180:230, 30:90], 0.02),
    "the whole table": lambda s: with_mask(s, s.segmap == 0),
}


def sane(result: Reconstruction) -> None:
    for item in result.objects:
        assert item.status in {"ok", "too_few_points", "no_surface", "failed"}
        assert (item.surface is not None) == (item.status == "ok")
        assert item.status == "ok" or item.message
        assert "does not know" not in item.message, item.message
        if item.surface is None:
            continue
        mesh = item.surface.as_trimesh()
        assert np.isfinite(mesh.vertices).all() and np.isfinite(item.surface.uncertainty).all()
        assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0
        assert mesh.extents.max() < 3.0
        assert np.linalg.norm(mesh.bounds.mean(axis=0)) < 60


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name in ("a line", "one pixel") else pytest.mark.long)
        for name in CASES
    ],
)
@pytest.mark.parametrize("method", ["brrp", pytest.param("vprism", marks=pytest.mark.long)])
def test_each_object_gets_a_status_or_a_sane_mesh(
    name: str, method: str, seen: Frame, prior: Path, tmp_path: Path
) -> None:
    frame = CASES[name](seen)
    result = reconstruct(frame, open_prior(prior) if method == "brrp" else None, method=method)
    assert [item.object_id for item in result.objects] == [BOX, 2]
    sane(result)
    assert result.objects[0].status == "ok", "the box is none the worse for its neighbour"
    write_results(result, tmp_path / "out")
    record = json.loads((tmp_path / "out" / "result.json").read_text(), parse_constant=pytest.fail)
    for entry in record["objects"]:
        if entry["mesh"]:
            mesh = trimesh.load(tmp_path / "out" / entry["mesh"], process=False)
            assert mesh.is_watertight and mesh.volume > 0
            assert np.isfinite(mesh.vertices).all()


@pytest.mark.long
@pytest.mark.parametrize("grow", [3, 12, 40])
def test_a_mask_that_bleeds_onto_the_table(grow: int, seen: Frame, prior: Path) -> None:
    from scipy.ndimage import binary_dilation

    mask = binary_dilation(seen.segmap == BOX, iterations=grow).astype(np.int64)
    frame = make_frame(rgb=seen.rgb, segmap=mask, depth=seen.points[..., 2], K=K)
    sane(reconstruct(frame, open_prior(prior)))


class Broken:
    """A retriever whose answer is no probability."""

    name = "broken"

    def __init__(self, answer) -> None:
        self.answer = np.asarray(answer)

    def probabilities(self, frame, object_id) -> np.ndarray:
        return self.answer


@pytest.mark.parametrize("answer", [[np.nan], [np.inf], [-0.1], [1.5], [0.2, 0.2], []])
def test_an_answer_that_is_no_probability_is_the_failure_of_its_object(
    answer, seen: Frame, prior: Path, tmp_path: Path
) -> None:
    result = reconstruct(seen, open_prior(prior), retriever=Broken(answer))
    (item,) = result.objects
    assert item.status == "failed" and "gave no probabilities" in item.message
    write_results(result, tmp_path / "out")
    assert json.loads((tmp_path / "out" / "result.json").read_text())["objects"][0]["mesh"] is None


def test_a_world_whose_origin_is_out_of_reach_of_single_precision_is_refused(
    seen: Frame, tmp_path: Path
) -> None:
    from brrp_cli.results.write import check_output

    T = np.eye(4)
    T[:3, 3] = [500_000.0, 4_000_000.0, 100.0]
    frame = make_frame(
        rgb=seen.rgb, segmap=seen.segmap, depth=seen.points[..., 2], K=K, T_world_cam=T
    )
    check_output(tmp_path / "out", frame, "camera", overwrite=False)
    with pytest.raises(OutputError, match="too far away"):
        check_output(tmp_path / "out", frame, "world", overwrite=False)
