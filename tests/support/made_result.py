"""A folder of results whose posteriors are known in closed form: a box and an L on a table."""

from __future__ import annotations

import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import trimesh
from table_scene import TABLE, in_camera, photograph, placed

from brrp_cli.config import preset
from brrp_cli.inference.hinge import HingeGrid
from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior
from brrp_cli.inference.mean_grid import MeanGrid
from brrp_cli.inference.posterior import HilbertPosterior
from brrp_cli.raycast import raycasting_scene
from brrp_cli.reconstruction import (
    OK,
    TOO_FEW_POINTS,
    ObjectReconstruction,
    Reconstruction,
    Retrieved,
)
from brrp_cli.results.write import write_results
from brrp_cli.shapes import solids
from brrp_cli.surface.extract import extract_surface

BOX, ELL, SPECK, UNMASKED = 7, -3, 40, 50
WIDTH = 0.002  # metres: a surface's place is logistic with this scale
SPACING, MARGIN = 0.003, 0.03


def solid_box() -> trimesh.Trimesh:
    return solids.box(0.09, 0.06, 0.12)


def hollow_ell() -> trimesh.Trimesh:
    """An L that stands on its longer leg; above that leg is nothing."""
    return solids.union(
        solids.box(0.14, 0.05, 0.03), solids.moved(solids.box(0.03, 0.05, 0.10), x=-0.055)
    )


HOLLOW = (0.08, 0.03, 0.05)  # above the longer leg, world


def truth() -> dict[int, trimesh.Trimesh]:
    """Meshes by id, camera frame."""
    return {
        BOX: in_camera(solid_box(), placed(-0.1, 0.0, 0.5)),
        ELL: in_camera(hollow_ell(), placed(0.08, 0.03, 0.0)),
    }


def posterior_on(
    functions, bounds: np.ndarray, which=(0,), spacing: float = SPACING
) -> HypothesisPosterior:
    """Particles without corrections: particle i is hypothesis which[i], whose logit at points
    (n, 3) is functions[which[i]](points)."""
    shape = np.ceil((bounds[1] - bounds[0]) / spacing).astype(int) + 1
    axes = [low + spacing * np.arange(n) for low, n in zip(bounds[0], shape, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    means = tuple(
        MeanGrid(bounds[0], spacing, np.clip(f(nodes), -8, 8).reshape(shape).astype("f2"), -8.0)
        for f in functions
    )
    grid = HingeGrid((0.0, 0.0, 0.0), (1, 1, 1), 1.0, 1e-7)
    none = HilbertPosterior(
        np.zeros((len(which), grid.dimension), np.float32), bounds.mean(axis=0), grid, 1.0
    )
    shares = np.full(len(which), 1 / len(which))
    return HypothesisPosterior(means, np.array(which), shares, none, means[0].bounds)


def around(mesh: trimesh.Trimesh) -> HypothesisPosterior:
    """Logit -distance / WIDTH of a mesh in the camera frame, two particles of it."""
    scene = raycasting_scene([mesh])

    def logit(points: np.ndarray) -> np.ndarray:
        distance = scene.compute_signed_distance(points.astype(np.float32), nsamples=11)
        return -distance.numpy() / WIDTH

    return posterior_on([logit], mesh.bounds + np.array([[-MARGIN], [MARGIN]]), which=(0, 0))


def _retrieved(name: str, probability: float, size: float, **scores: float) -> Retrieved:
    T = np.eye(4)
    return Retrieved(name, probability, T, T_cam_mesh=T, size_factor=size, **scores)


def write_made_result(
    folder: Path, *, frame: str = "camera", unmasked: trimesh.Trimesh | None = None
) -> Path:
    """The box, the L, and a speck of four pixels without a mesh.

    unmasked : what has no mask, camera frame
    """
    if unmasked is None:
        return Path(shutil.copytree(Path(_plain(frame).name) / "out", folder))
    return _written(folder, frame, unmasked)


@cache
def _plain(frame: str) -> TemporaryDirectory[str]:
    """What most tests want, written once in each process."""
    kept = TemporaryDirectory(prefix="brrp_made_")
    _written(Path(kept.name) / "out", frame, None)
    return kept


def _written(folder: Path, frame: str, unmasked: trimesh.Trimesh | None) -> Path:
    meshes = truth()
    seen = photograph(meshes if unmasked is None else meshes | {UNMASKED: unmasked})
    segmap = np.where(seen.segmap == UNMASKED, 0, seen.segmap)
    segmap[-2:, :2] = SPECK
    seen = replace(seen, segmap=segmap)
    config = preset("default")
    objects = [ObjectReconstruction(SPECK, TOO_FEW_POINTS, "4 valid depth points, 16 are needed")]
    for object_id, mesh in meshes.items():
        item = ObjectReconstruction(
            object_id,
            OK,
            n_points=int((segmap == object_id).sum()),
            retrieved=[
                _retrieved("a <b>box</b> & more", 0.75, 1.0, alignment_score=0.9, weight=0.97),
                _retrieved("mug", 0.05, 0.9, alignment_score=0.2, weight=0.0),
            ],
            unknown_probability=0.2,
            unknown_weight=0.03,
            observed=seen.object_points(object_id),
            posterior=around(mesh),
            seconds={"retrieval": 0.5, "surface": 0.25},
        )
        item.surface = extract_surface(item.posterior, item.observed, config.surface)
        objects.append(item)
    result = Reconstruction(
        frame=seen,
        objects=sorted(objects, key=lambda o: o.object_id),
        plane=TABLE,
        method="brrp",
        retriever="appearance",
        prior_path=Path("prior"),
        prior_digest="0" * 64,
        configuration=config.as_dict(),
        seed=0,
        device="cpu",
    )
    write_results(result, folder, frame=frame)
    return folder
