"""What a planner of grasps knows of a scene: objects, their posteriors, the table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SurfaceConfig
from brrp_cli.config.grasping import GraspConfig, SurroundingsConfig
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.config.tables import changed
from brrp_cli.errors import ResultError
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import IMAGE_UP, transform_points
from brrp_cli.grasping.hidden_space import NOTHING_HIDDEN, HiddenSpace, hidden_behind
from brrp_cli.grasping.standing_around import standing_around
from brrp_cli.observation.support_plane import Plane
from brrp_cli.reconstruction import OccupancyPosterior, Reconstruction
from brrp_cli.results.read import StoredResult
from brrp_cli.segmentation.bin_walls import Solid
from brrp_cli.segmentation.furniture import furniture, segmentation_of
from brrp_cli.segmentation.reaching_in import arms_in

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GraspObject:
    """vertices (n, 3) and faces (m, 3) of its closed, outward mesh, metres, camera frame; observed
    (k, 3), its points, the same. posterior : None where its mesh is all that is known."""

    object_id: int
    vertices: Array
    faces: NDArray[np.int64]
    observed: NDArray[np.floating]
    posterior: OccupancyPosterior | None


@dataclass(frozen=True)
class GraspScene:
    """objects : those that have a mesh; plane : the table, camera frame; without : why others have
    none, by id; loose : (n, 3) observed points of those, and of what stands around; surface : how
    meshes were made; solids : corners (k, 3), convex, of platforms, the walls of bins and
    what shuts the table off, camera frame; hidden : behind what stands around"""

    objects: list[GraspObject]
    plane: Plane | None
    without: dict[int, str]
    loose: Array
    surface: SurfaceConfig
    solids: Sequence[Solid] = ()
    hidden: HiddenSpace = NOTHING_HIDDEN

    @property
    def up(self) -> Array:
        """(3,) the table's normal; without a table, up in the image."""
        return IMAGE_UP if self.plane is None else np.asarray(self.plane.normal, dtype=np.float64)


def scene_of(
    result: Reconstruction | StoredResult, config: GraspConfig | None = None
) -> GraspScene:
    """The scene of a reconstruction, or of a folder of results.

    Errors: ResultError where no object has a mesh; those of reading the folder.
    """
    around = (config or GraspConfig()).surroundings
    if isinstance(result, StoredResult):
        scene = _stored(result, around)
    else:
        scene = _computed(result, around)
    if not scene.objects:
        raise ResultError(
            "No object of the results has a mesh, so that there is nothing to grasp",
            where=result.folder if isinstance(result, StoredResult) else None,
            expected="one object with a mesh at least",
            found=", ".join(f"object {i}: {why}" for i, why in scene.without.items()) or "none",
            fix="look at the masks with `brrp view`, correct them, and reconstruct again",
        )
    return scene


def _stored(stored: StoredResult, around: SurroundingsConfig) -> GraspScene:
    T_cam_frame = np.linalg.inv(stored.T_frame_cam)
    objects = [
        GraspObject(
            object_id,
            np.asarray(transform_points(T_cam_frame, surface.vertices), dtype=np.float64),
            surface.faces,
            stored.frame.object_points(object_id),
            stored.posteriors[object_id],
        )
        for object_id, surface in stored.surfaces.items()
    ]
    without = {
        item["id"]: item["message"] or item["status"]
        for item in stored.record["objects"]
        if item["mesh"] is None
    }
    plane, masks = stored.plane_cam, segmentation_of(stored.record["segmentation"])
    seed = stored.record["seed"]
    loose, hidden = _loose(stored.frame, plane, objects, without, around, masks, seed)
    found = furniture(stored.frame, plane, seed, masks)
    table = None if plane is None else found.table(plane)
    return GraspScene(objects, table, without, loose, stored.surface_config, found.solids, hidden)


def _computed(result: Reconstruction, around: SurroundingsConfig) -> GraspScene:
    objects = [
        GraspObject(
            each.object_id,
            each.surface.vertices,
            each.surface.faces,
            result.frame.object_points(each.object_id),
            each.posterior,
        )
        for each in result.objects
        if each.surface is not None
    ]
    without = {o.object_id: o.message or o.status for o in result.objects if o.surface is None}
    masks = segmentation_of(result.segmentation)
    loose, hidden = _loose(result.frame, result.plane, objects, without, around, masks, result.seed)
    numbers = result.configuration.get("surface", {})
    surface = changed(SurfaceConfig(), numbers, "the reconstruction", "surface.")
    found = furniture(result.frame, result.plane, result.seed, masks)
    plane = None if result.plane is None else found.table(result.plane)
    return GraspScene(objects, plane, without, loose, surface, found.solids, hidden)


def _loose(
    frame: Frame,
    plane: Plane | None,
    objects: list[GraspObject],
    without: dict[int, str],
    config: SurroundingsConfig,
    masks: SegmentConfig,
    seed: int,
) -> tuple[Array, HiddenSpace]:
    """(n, 3) observed points that a hand keeps out of, of objects without a mesh and of none, and
    the space behind the latter."""
    clouds = [frame.object_points(i) for i in without]
    surfaces = [each for item in objects for each in (item.vertices, item.observed)]
    known = _joined([*surfaces, *clouds])
    arms = None if config.arms else arms_in(frame, seed, masks)
    around = standing_around(frame, plane, known, config, masks.smooth_depth, arms)
    return _joined([*clouds, around]), hidden_behind(around, config)


def _joined(clouds: list[NDArray[np.floating]]) -> Array:
    return np.concatenate([np.zeros((0, 3)), *clouds]).astype(np.float64)
