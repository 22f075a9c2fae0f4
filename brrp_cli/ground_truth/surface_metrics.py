"""A reconstructed mesh against the exact one: what a user gets, measured on the mesh alone.

Points are drawn uniformly by area from either surface; each is held against the nearest point of
the other surface's triangles, so that no sampling adds to a distance.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_open3d
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import at_pixels
from brrp_cli.geometry import normalise
from brrp_cli.ground_truth.metrics import f_score_of_distances
from brrp_cli.ground_truth.pieces import count_pieces
from brrp_cli.ground_truth.thickness import thickness_class
from brrp_cli.ground_truth.true_meshes import ExactMesh
from brrp_cli.raycast import raycasting_scene
from brrp_cli.seeds import child_rng

if TYPE_CHECKING:
    import trimesh

Points = NDArray[np.float64]
Flags = NDArray[np.bool_]

SURFACE_POINTS = 4_000
F_SCORES = {"f_score_2mm": 0.002, "f_score_5mm": 0.005, "f_score_10mm": 0.010}  # metres
VOLUME_SHARES = {"volume_within_10": 0.10, "volume_within_25": 0.25}
SURFACE_METRICS = (
    "surface_distance",
    "distance_to_truth",
    "distance_from_truth",
    *F_SCORES,
    "volume_ratio",
    *VOLUME_SHARES,
    "watertight",
    "pieces",
    "one_piece",
    "normal_consistency",
    "normal_consistency_seen",
    "surface_distance_seen",
    "surface_distance_unseen",
    "surface_bias",
    "surface_bias_seen",
    "surface_bias_unseen",
)
# Rays that tell inside from outside; a sign that is wrong once in thousands moves no mean.
_RAYS = 3
# Metres: what lies at least so far behind the first hit of its ray is hidden.
_HIDDEN = 0.0005


@dataclass(frozen=True)
class Nearest:
    """Of points (n, 3): the nearest points (n, 3) of a surface, their distances (n,), and the unit
    normals (n, 3) of the triangles that they lie on."""

    points: Points
    distance: Points
    normals: Points


class MeshSurface:
    """A triangle mesh that is asked for nearest points; metres, any frame."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        self.mesh = mesh
        self._center = np.asarray(mesh.bounds, dtype=np.float64).mean(axis=0)

    @cached_property
    def _scene(self) -> Any:
        # Open3D computes in single precision: far from the origin it would lose millimetres.
        return raycasting_scene([self.mesh.copy().apply_translation(-self._center)])

    def sample(self, count: int, rng: np.random.Generator) -> tuple[Points, Points]:
        """Points (count, 3), uniform by area, and the unit normals (count, 3) of their faces."""
        import trimesh

        points, faces = trimesh.sample.sample_surface(self.mesh, count, seed=rng)
        return np.asarray(points), np.asarray(self.mesh.face_normals[faces])

    def nearest(self, points: Points) -> Nearest:
        """The nearest points of the surface to `points` (n, 3)."""
        local = np.ascontiguousarray(points - self._center, dtype=np.float32)
        found = self._scene.compute_closest_points(import_open3d().core.Tensor(local))
        nearest = found["points"].numpy().astype(np.float64)
        return Nearest(
            points=nearest + self._center,
            distance=np.linalg.norm(nearest - local, axis=1),
            normals=normalise(found["primitive_normals"].numpy().astype(np.float64)),
        )

    def inside(self, points: Points) -> Flags:
        """Which of `points` (n, 3) lie inside; the mesh is closed."""
        local = np.ascontiguousarray(points - self._center, dtype=np.float32)
        query = import_open3d().core.Tensor(local)
        return np.asarray(self._scene.compute_occupancy(query, nsamples=_RAYS).numpy() > 0.5)

    def reached_from(self, eye: Points, points: Points) -> Flags:
        """Which of `points` (n, 3) of the surface a ray from `eye` (3,) meets first."""
        rays = np.hstack([np.broadcast_to(eye - self._center, points.shape), points - eye])
        hits = self._scene.cast_rays(import_open3d().core.Tensor(rays.astype(np.float32)))
        way = np.linalg.norm(points - eye, axis=1)
        return np.asarray((1 - hits["t_hit"].numpy()) * way <= _HIDDEN)


@dataclass(frozen=True)
class TrueSurface:
    """The exact mesh, closed, as written meshes are held against it; metres, camera frame.

    points, normals : (n, 3) drawn uniformly by area, with unit normals; seen : (n,) which of them
        the camera saw
    thickness : median, metres; pieces : connected pieces of the mesh
    """

    surface: MeshSurface
    frame: Frame
    object_id: int
    points: Points
    normals: Points
    seen: Flags
    thickness: float
    pieces: int

    @property
    def thickness_class(self) -> str:
        """Shell, thin or solid."""
        return thickness_class(self.thickness)

    def sees(self, points: Points) -> Flags:
        """Which of `points` (m, 3) of the surface the camera saw: (m,)."""
        return camera_sees(self.surface, points, self.frame, self.object_id)


def true_surface(
    exact: ExactMesh, frame: Frame, object_id: int, scene: str, seed: int
) -> TrueSurface:
    """The true surface of an object of `frame` whose mesh is in the camera frame, metres.

    scene, seed : decide, with the object, which points are drawn
    """
    surface = MeshSurface(exact.mesh)
    rng = child_rng(seed, "true surface", scene, object_id)
    points, normals = surface.sample(SURFACE_POINTS, rng)
    seen = camera_sees(surface, points, frame, object_id)
    return TrueSurface(
        surface, frame, object_id, points, normals, seen, exact.thickness, exact.pieces
    )


def camera_sees(surface: MeshSurface, points: Points, frame: Frame, object_id: int) -> Flags:
    """Which of `points` (n, 3) of an object's surface, camera frame, the camera saw: those whose
    ray meets them first, and whose pixel is the object's."""
    mine = at_pixels(points, frame.segmap, frame) == object_id
    return mine & surface.reached_from(np.zeros(3), points)


def score_surface(
    mesh: trimesh.Trimesh | None, truth: TrueSurface, rng: np.random.Generator
) -> dict[str, float]:
    """`SURFACE_METRICS` of a mesh in the frame of the truth; lengths in metres.

    distance_to_truth, distance_from_truth : mean distance from points of the mesh to the true
    surface, and back; surface_distance : their mean
    f_score_* : harmonic mean of the shares of either's points within that distance of the other
    (Tatarchenko et al., CVPR 2019)
    volume_ratio : over the true volume; NaN for an open mesh. volume_within_* : 1 within 10 %, 25 %
    watertight : every edge has two faces, wound alike, facing outward. pieces : connected parts of
    the surface; one_piece : no more than the true mesh has
    normal_consistency : mean |cos| of the angle between the normals at nearest points, both ways
    (Mescheder et al., CVPR 2019, section 4)
    *_seen, *_unseen : over the points of the true surface that the camera saw, or not, and over the
    mesh's points whose nearest point of the true surface is such a one
    surface_bias : mean signed distance of the mesh's points to the true surface; above 0 outside

    Without a mesh (None, or one without area) the F-scores are 0, nothing is closed, whole or of
    the right volume, and the rest is NaN.
    """
    if mesh is None or len(mesh.faces) == 0 or not mesh.area > 0:
        return no_surface()
    made = MeshSurface(mesh)
    points, normals = made.sample(SURFACE_POINTS, rng)
    forth, back = truth.surface.nearest(points), made.nearest(truth.points)
    to_seen = truth.sees(forth.points)
    signed = np.where(truth.surface.inside(points), -forth.distance, forth.distance)
    # A nearest face without area has no normal.
    cosines = _cosines(normals, forth.normals), _cosines(truth.normals, back.normals)

    def both(values: tuple[Points, Points], to: Flags, of: Flags) -> float:
        return _mean(np.array([_mean(values[0][to]), _mean(values[1][of])]))

    everywhere = np.ones(len(points), bool), np.ones(len(truth.points), bool)
    distances = forth.distance, back.distance
    return {
        "surface_distance": both(distances, *everywhere),
        "distance_to_truth": float(forth.distance.mean()),
        "distance_from_truth": float(back.distance.mean()),
        **{name: f_score_of_distances(*distances, limit) for name, limit in F_SCORES.items()},
        **_solidity(mesh, truth),
        "normal_consistency": both(cosines, *everywhere),
        "normal_consistency_seen": both(cosines, to_seen, truth.seen),
        "surface_distance_seen": both(distances, to_seen, truth.seen),
        "surface_distance_unseen": both(distances, ~to_seen, ~truth.seen),
        "surface_bias": float(signed.mean()),
        "surface_bias_seen": _mean(signed[to_seen]),
        "surface_bias_unseen": _mean(signed[~to_seen]),
    }


def score_written(
    mesh: trimesh.Trimesh | None, truth: TrueSurface, scene: str, seed: int
) -> dict[str, float]:
    """`score_surface` with the points that scene, object and seed decide."""
    return score_surface(mesh, truth, child_rng(seed, "written", scene, truth.object_id))


def no_surface() -> dict[str, float]:
    """What an object without a mesh scores."""
    zero = (*F_SCORES, *VOLUME_SHARES, "watertight", "pieces", "one_piece")
    return {name: 0.0 if name in zero else float("nan") for name in SURFACE_METRICS}


def _solidity(mesh: trimesh.Trimesh, truth: TrueSurface) -> dict[str, float]:
    # Every edge has two faces, wound alike, and the volume is above 0.
    closed = bool(mesh.is_volume)
    ratio = float(mesh.volume / truth.surface.mesh.volume) if closed else float("nan")
    pieces = count_pieces(mesh)
    return {
        "volume_ratio": ratio,
        # Whatever is compared with NaN is false.
        **{name: float(abs(ratio - 1) <= share) for name, share in VOLUME_SHARES.items()},
        "watertight": float(closed),
        "pieces": float(pieces),
        "one_piece": float(pieces <= truth.pieces),
    }


def _cosines(normals: Points, others: Points) -> Points:
    found = np.abs(np.einsum("nc,nc->n", normals, others))
    return np.where(np.linalg.norm(others, axis=1) > 0, found, np.nan)


def _mean(values: Points) -> float:
    """NaN where there is no value."""
    there = values[~np.isnan(values)]
    return float(there.mean()) if len(there) else float("nan")
