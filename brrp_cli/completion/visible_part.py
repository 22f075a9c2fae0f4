"""One object as far as a frame shows it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brrp_cli.completion.convex_hull import hull_facets, outside_hull
from brrp_cli.completion.height_map import HeightMap, height_map_over
from brrp_cli.completion.plan_rectangle import PlanRectangle, plan_rectangle
from brrp_cli.completion.radial_profile import RadialProfile, radial_profile
from brrp_cli.completion.silhouette import Image, silhouettes
from brrp_cli.config import CompletionConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import depth_behind
from brrp_cli.geometry import normalise, transform_points
from brrp_cli.observation.subsample import grid_subsample
from brrp_cli.observation.support_plane import Plane

Array = NDArray[np.float64]

# Of the image: as good a guess as any where there is no plane.
UPRIGHT = np.array([0.0, -1.0, 0.0])


@dataclass(frozen=True)
class VisiblePart:
    """Metres, camera frame.

    seen : (n, 3) observed points, thinned; feet : (m, 3) theirs on the plane, none without one
    facets : (f, 4) of the hull of both, outward unit normal and offset
    height_map : None without a plane
    size : diagonal of the box of the seen points; top : the height of the highest over the plane
    ahead, across : (3,) unit directions along the plane, away from the camera and across; front,
    back : where the seen points begin and end ahead; middle, width : of them across
    depths : (n,) how deep the seen points lie in the hull: much of a cup's inside does
    normals : (n, 3) of the seen points, unit, towards the camera
    rectangle : along `across` and `ahead`, of what is seen; profile : about the upright axis in the
    middle of a round thing with that front and width, heights along `up`
    free : share of the points halfway between two seen ones that are seen to be free: none in a
    solid block, a third in a bowl that is looked into
    silhouette, thickness : (H, W) pixels, of silhouette.py
    """

    frame: Frame
    object_id: int
    plane: Plane | None
    seen: Array
    feet: Array
    facets: Array
    height_map: HeightMap | None
    size: float
    top: float
    ahead: Array
    across: Array
    front: float
    back: float
    middle: float
    width: float
    depths: Array
    normals: Array
    rectangle: PlanRectangle
    profile: RadialProfile
    free: float
    silhouette: Image
    thickness: Image
    config: CompletionConfig

    @property
    def up(self) -> Array:
        """(3,) unit, away from the plane."""
        return UPRIGHT if self.plane is None else self.plane.normal

    @property
    def center(self) -> float:
        """How far behind the front the middle of something round is."""
        return max(self.width, self.back - self.front) / 2

    @cached_property
    def tree(self) -> cKDTree:
        """Of the seen points."""
        return _tree(self.seen)

    @cached_property
    def tree_on_plane(self) -> cKDTree:
        """The same of where they lie along the plane, by the height map's axes."""
        assert self.height_map is not None
        return _tree(transform_points(self.height_map.T_plane_cam, self.seen)[:, :2])

    @property
    def extent(self) -> Array:
        """(n + m, 3) points that span what is likely to be the object."""
        return np.concatenate([self.seen, self.feet])


def visible_part(
    points: NDArray[np.floating],
    frame: Frame,
    object_id: int,
    plane: Plane | None,
    config: CompletionConfig,
) -> VisiblePart:
    """From an object's observed points (n, 3), metres, camera frame, and its support plane."""
    seen = grid_subsample(points, config.cell).astype(np.float64)
    low, high = np.quantile(seen, config.most, axis=0)
    size = max(float(np.linalg.norm(high - low)), config.least)
    up = UPRIGHT if plane is None else plane.normal
    if plane is None:
        feet, height_map, top = np.zeros((0, 3)), None, size / 2
    else:
        height = np.maximum(plane.signed_distance(seen), 0.0)
        feet = seen - height[:, None] * up
        height_map = height_map_over(points, plane, config)
        top = float(np.quantile(height, config.most[1]))
    silhouette, thickness = silhouettes(frame, object_id, config)
    facets = hull_facets(np.concatenate([seen, feet]), config.thickness)
    sight = seen.mean(axis=0)
    across = normalise(np.cross(up, sight))
    ahead = np.cross(across, up)
    front, back = np.quantile(seen @ ahead, config.most)
    left, right = np.quantile(seen @ across, config.most)
    width = max(float(right - left), config.least)
    normals = surface_normals(seen, config.neighbours)
    x = seen @ across - (left + right) / 2
    y = seen @ ahead - front - max(width, float(back - front)) / 2
    radii = np.maximum(np.hypot(x, y), config.least / 10)
    outward = (x * (normals @ across) + y * (normals @ ahead)) / radii
    return VisiblePart(
        frame=frame,
        object_id=object_id,
        plane=plane,
        seen=seen,
        feet=feet,
        facets=facets,
        height_map=height_map,
        size=size,
        top=top,
        ahead=ahead,
        across=across,
        front=float(front),
        back=float(back),
        middle=float(left + right) / 2,
        width=width,
        depths=-outside_hull(seen, facets),
        normals=normals,
        rectangle=plan_rectangle(np.stack([seen @ across, seen @ ahead], axis=1), config),
        profile=radial_profile(seen @ up, radii, outward, config.levels),
        free=_free_between(seen, frame, config),
        silhouette=silhouette,
        thickness=thickness,
        config=config,
    )


def _tree(points: NDArray[np.floating]) -> cKDTree:
    """Of points (n, d) on a grid that are asked from far away: cells halved in the middle are
    passed by sooner there than those that hold the same number of points each."""
    return cKDTree(points, leafsize=32, balanced_tree=False, compact_nodes=False)


def surface_normals(seen: Array, neighbours: int) -> Array:
    """Unit normals (n, 3), towards the camera, of points (n, 3), camera frame: the direction in
    which a point's neighbours vary least."""
    count = min(neighbours, len(seen))
    _, rows = cKDTree(seen).query(seen, k=[*range(1, count + 1)])
    near = seen[rows] - seen[rows].mean(axis=1, keepdims=True)
    _, directions = np.linalg.eigh(np.einsum("nki,nkj->nij", near, near))
    normals = directions[:, :, 0]
    away = (normals * seen).sum(axis=1, keepdims=True) > 0
    return np.where(away, -normals, normals)


def _free_between(seen: Array, frame: Frame, config: CompletionConfig) -> float:
    """Share of the points halfway between two of `seen` (n, 3) that are seen to be free."""
    # A feature is a function of what is seen: the pairs are the same whatever the seed.
    pairs = np.random.default_rng(0).integers(len(seen), size=(2, config.pairs))
    behind = depth_behind(seen[pairs].mean(axis=0), frame)
    return float((np.nan_to_num(behind, nan=0.0) > config.free).mean())
