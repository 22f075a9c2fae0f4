"""From results to bodies on a table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrp_cli.completion.completed_mean import empty_space
from brrp_cli.config import MeanConfig, StrayConfig
from brrp_cli.config.planning import PartsConfig, TableBoxConfig
from brrp_cli.errors import ResultError
from brrp_cli.geometry import IMAGE_UP, similarity, transform_points
from brrp_cli.observation.strays import without_strays
from brrp_cli.observation.support_plane import Plane
from brrp_cli.planning.body import Body, body_axes, body_pose, mass_and_inertia
from brrp_cli.planning.decompose import NamedMesh, parts_of
from brrp_cli.planning.mjcf import TableBox
from brrp_cli.planning.options import PlanOptions
from brrp_cli.reconstruction import Surface
from brrp_cli.results.read import StoredResult
from brrp_cli.segmentation.furniture import Furniture, furniture, segmentation_of
from brrp_cli.surface.confidence import ConfidenceSurface, confidence_surface
from brrp_cli.surface.free_space import free_balls

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class PlannedObject:
    """A body, and the region that its collision shape was made of where one was asked for."""

    object_id: int
    body: Body
    region: ConfidenceSurface | None


def planned_objects(stored: StoredResult, options: PlanOptions) -> Iterator[PlannedObject]:
    """One for each object that has a mesh, as soon as it is made.

    Errors: ResultError where a mesh encloses nothing; DependencyError without CoACD.
    """
    shapes = [_shape(stored, i, surface, options) for i, surface in stored.surfaces.items()]
    solids = [
        NamedMesh(
            str(stored.folder / f"object {shape.object_id}"),
            np.asarray(shape.collision.vertices, dtype=np.float64),
            np.asarray(shape.collision.faces, dtype=np.int64),
        )
        for shape in shapes
    ]
    found = parts_of(solids, options.collision, options.seed, PartsConfig())
    for shape, parts in zip(shapes, found, strict=True):
        mass, inertia = mass_and_inertia(shape.local, options.density)
        body = Body(
            name=f"object_{shape.object_id}",
            T_frame_body=shape.T_frame_body,
            mesh=shape.local,
            collision=shape.collision,
            parts=parts,
            mass=mass,
            inertia=inertia,
            colour=_colour(stored, shape.object_id),
        )
        yield PlannedObject(shape.object_id, body, shape.region)


@dataclass(frozen=True)
class _Shape:
    """An object's mesh, and what its collision shape is made of, both in the body's frame."""

    object_id: int
    T_frame_body: NDArray[np.float64]
    local: trimesh.Trimesh
    collision: trimesh.Trimesh
    region: ConfidenceSurface | None


def _shape(stored: StoredResult, object_id: int, surface: Surface, options: PlanOptions) -> _Shape:
    mesh = surface.as_trimesh()
    if not mesh.is_watertight or mesh.volume <= 0:
        raise ResultError(
            "A mesh of the results encloses nothing",
            where=stored.folder / f"object {object_id}",
            fix="run `brrp reconstruct` again",
        )
    region = None
    if options.confidence is not None:
        region = _region(stored, object_id, options.confidence, options.margin)
    T_frame_cam = stored.T_frame_cam
    T_frame_body = body_pose(mesh, body_axes(upwards(stored), T_frame_cam[:3, 0]))
    T_body_frame = np.linalg.inv(T_frame_body)
    local = mesh.copy().apply_transform(T_body_frame)
    collision = local if region is None else _as_mesh(region, T_body_frame @ T_frame_cam)
    return _Shape(object_id, T_frame_body, local, collision, region)


def upwards(stored: StoredResult) -> NDArray[np.float64]:
    """(3,) the table's normal in the frame of the meshes; without a table, up in the image."""
    plane = stored.plane
    return stored.T_frame_cam[:3, :3] @ IMAGE_UP if plane is None else plane.normal


def table_under(
    bodies: list[Body],
    plane: Plane | None,
    config: TableBoxConfig,
    around: Furniture | None = None,
) -> TableBox | None:
    """A table whose top is the plane, or lies below it where that is a platform's, under all
    bodies, bins and platforms; None without a plane.

    around : what stands on it and shuts it off, frame of the results
    """
    around = around or Furniture()
    if plane is None or not bodies:
        return None
    axes = body_axes(plane.normal, bodies[0].T_frame_body[:3, 0])
    corners = np.vstack(
        [
            *(transform_points(b.T_frame_body, np.vstack(b.parts)) for b in bodies),
            *(wall for walls in around.bins for wall in walls),
            *around.platforms,
        ]
    )
    local = corners @ axes
    low, high = local.min(axis=0) - config.margin, local.max(axis=0) + config.margin
    middle = (low + high) / 2
    middle[2] = -around.table(plane).offset - config.thickness / 2
    size = np.array([*(high - low)[:2], config.thickness])
    bins = {f"bin_{number}": walls for number, walls in enumerate(around.bins, start=1)}
    walls = {f"wall_{number}": [wall] for number, wall in enumerate(around.walls, start=1)}
    platforms = {
        f"platform_{number}": [solid] for number, solid in enumerate(around.platforms, start=1)
    }
    return TableBox(similarity(1.0, axes, axes @ middle), size, bins, walls, platforms)


def furniture_around(stored: StoredResult) -> Furniture:
    """What stands on the table and shuts it off, frame of the results."""
    config = segmentation_of(stored.record["segmentation"])
    found = furniture(stored.frame, stored.plane_cam, stored.record["seed"], config)
    return found.moved(stored.T_frame_cam)


def _region(
    stored: StoredResult, object_id: int, confidence: float, margin: float
) -> ConfidenceSurface:
    frame, plane, config = stored.frame, stored.plane_cam, MeanConfig()

    def empty(points: NDArray[np.float64]) -> NDArray[np.bool_]:
        return empty_space(points, frame, object_id, plane, config)

    def free(points: NDArray[np.float64], radius: float) -> NDArray[np.bool_]:
        return free_balls(points, radius, frame, plane, config)

    found = confidence_surface(
        stored.posteriors[object_id],
        without_strays(frame, StrayConfig(), (), [object_id]).object_points(object_id),
        confidence,
        stored.surface_config,
        margin,
        empty,
        free,
    )
    if found is None:
        raise ResultError(
            "The posterior holds the object for empty, but it has a mesh",
            where=stored.folder / f"object {object_id}",
            fix="run `brrp reconstruct` again",
        )
    return found


def _as_mesh(region: ConfidenceSurface, T_body_cam: NDArray[np.float64]) -> trimesh.Trimesh:
    import trimesh

    return trimesh.Trimesh(
        transform_points(T_body_cam, region.vertices), region.faces, process=False
    )


def _colour(stored: StoredResult, object_id: int) -> NDArray[np.float64]:
    """(3,) median of the object's pixels, 0 to 1."""
    pixels = stored.frame.rgb[stored.frame.segmap == object_id]
    return np.median(pixels, axis=0) / 255 if len(pixels) else np.full(3, 0.5)
