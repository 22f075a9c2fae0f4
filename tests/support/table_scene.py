"""Solids on a table seen by a camera whose every ray is cast, and the same solids as stored ones.

World: z up, the table's top at z = 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import trimesh

from brrp_cli.completion.completed_mean import logits_within, network_grid, shell_of
from brrp_cli.completion.seen_surface import SeenSurface, seen_surface
from brrp_cli.completion.visible_part import VisiblePart
from brrp_cli.config import FeatureConfig, MeanConfig, preset
from brrp_cli.demo.layout import camera_pose
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject, similarity, turn_about_z
from brrp_cli.observation.pixel_noise import pixel_noise
from brrp_cli.observation.support_plane import Plane
from brrp_cli.prior.build.find_meshes import MeshSource
from brrp_cli.prior.build.make_object import make_object
from brrp_cli.prior.objects import PriorObject
from brrp_cli.prior.parameters import AppearanceConfig, BuildParameters
from brrp_cli.raycast import look
from brrp_cli.registration.likelihood import see
from brrp_cli.registration.verification import Verifier
from brrp_cli.registration.views import SeenFrom, Views
from brrp_cli.shapes import solids

K = np.array([[300.0, 0, 160], [0, 300.0, 120], [0, 0, 1]])
SHAPE = (240, 320)
T_WORLD_CAM = camera_pose(np.array([0.0, 0.0, 0.03]), 0.7, 0.7, 0.4)
T_CAM_WORLD = np.linalg.inv(T_WORLD_CAM)
NORMAL = T_CAM_WORLD[:3, 2]
TABLE = Plane(NORMAL, float(-NORMAL @ T_CAM_WORLD[:3, 3]))

# The stored clouds and surfaces of a real prior, less of what these tests do not ask for.
PARAMETERS = BuildParameters(
    samples=500,
    dense_points=8_000,
    features=FeatureConfig(scales=(0.4, 0.5, 0.6)),
    appearance=AppearanceConfig(views=2, rays=100),
)


def box() -> trimesh.Trimesh:
    """Three different sides, so that it fits in one way up to half turns."""
    return solids.box(0.10, 0.06, 0.14)


def ell() -> trimesh.Trimesh:
    """An L that stands on its longer leg: no turn maps it to itself."""
    return solids.union(
        solids.box(0.14, 0.05, 0.04), solids.moved(solids.box(0.03, 0.05, 0.10), x=-0.055)
    )


def beaker() -> trimesh.Trimesh:
    """Its walls are thinner than the nodes of a stored field are apart."""
    return solids.beaker(0.035, 0.04, 0.09, 0.002)


def ball() -> trimesh.Trimesh:
    """Radius 5 cm, on the table."""
    return solids.moved(trimesh.creation.icosphere(subdivisions=4, radius=0.05), z=0.05)


def fruit() -> trimesh.Trimesh:
    """Nearly a ball: dents and bumps of 2 mm, which no turn maps to themselves."""
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    x, y, z = mesh.vertices.T / 0.05
    bumps = np.sin(3 * x + 1) * np.cos(2 * y) + 0.5 * np.sin(4 * z + x)
    mesh.vertices *= (1 + 0.04 * bumps)[:, None]
    return solids.moved(mesh, z=-mesh.bounds[0, 2])


def mug() -> trimesh.Trimesh:
    """A can with a handle on its +x side."""
    return solids.union(
        solids.cylinder(0.04, 0.1), solids.moved(solids.box(0.04, 0.015, 0.06), x=0.05, z=0.035)
    )


MESHES = {"box": box, "ell": ell, "ball": ball, "beaker": beaker, "fruit": fruit, "mug": mug}


@cache
def stored(name: str) -> PriorObject:
    """One of `MESHES`, made as a build makes it."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.ply"
        MESHES[name]().export(path)
        return make_object(MeshSource(name, path, path.name), PARAMETERS)


def placed(x: float, y: float, yaw: float) -> np.ndarray:
    """T_cam_mesh (4, 4) of what stands on the table there, turned by `yaw`."""
    return T_CAM_WORLD @ similarity(1.0, turn_about_z(yaw), np.array([x, y, 0.0]))


def in_camera(mesh: trimesh.Trimesh, T_cam_mesh: np.ndarray) -> trimesh.Trimesh:
    """A moved copy."""
    copy = mesh.copy()
    copy.apply_transform(T_cam_mesh)
    return copy


def surface_seen(frame: Frame, object_id: int) -> SeenSurface:
    """What the completion takes from a frame's depth of an object on the table."""
    hypotheses = preset("default").hypotheses
    noise = pixel_noise(frame, TABLE, hypotheses.sensor)
    return seen_surface(frame, object_id, TABLE, noise, hypotheses.mean.ramp)


def completed_grid(
    nodes: np.ndarray,
    empty: np.ndarray,
    part: VisiblePart,
    surface: SeenSurface,
    config: MeanConfig,
) -> np.ndarray:
    """Logits (nx, ny, nz) of the completion of one view at nodes (nx, ny, nz, 3)."""
    bounds = surface.bounds(nodes[~empty], shell_of(nodes, config), config)
    return logits_within(network_grid(nodes, empty, part, config), empty, bounds, config)


def photograph(
    things: Mapping[int, trimesh.Trimesh],
    *,
    table: bool = True,
    T_world_cam: np.ndarray = T_WORLD_CAM,
) -> Frame:
    """A frame of meshes by id, camera frame, on the table or in the air; depth without noise."""
    slab = solids.moved(solids.box(1.4, 1.4, 0.02), z=-0.02)
    slab = in_camera(slab, np.linalg.inv(T_world_cam))
    sight = look([*things.values(), *([slab] if table else [])], K, SHAPE)
    ids = np.array([*things, 0, 0])
    return Frame(
        rgb=np.full((*SHAPE, 3), 128, np.uint8),
        points=backproject(sight.depth, K),
        segmap=ids[np.where(sight.index < 0, len(things), sight.index)].astype(np.int64),
        K=K,
        T_world_cam=T_world_cam,
    )


def seen_from(frame: Frame, T_view_cam: np.ndarray, object_id: int = 1) -> SeenFrom:
    """What a frame shows of one object on `TABLE`; T_view_cam as of `SeenFrom`."""
    config = preset("default").hypotheses
    sensor, noise = config.sensor, pixel_noise(frame, TABLE, config.sensor)
    pixels = see(frame, object_id, TABLE, noise, sensor.patch, sensor.bleed, config.likelihood)
    return SeenFrom(pixels, T_view_cam)


def one_view(verifier: Verifier) -> Views:
    """Of object 1, in a frame that stands alone."""
    return Views((seen_from(verifier.frame, np.eye(4)),), verifier.points, 1.0)


def verifier_of(mesh: trimesh.Trimesh, T_cam_mesh: np.ndarray) -> Verifier:
    """What a frame says of a mesh that stands or floats there."""
    frame = photograph({1: in_camera(mesh, T_cam_mesh)})
    points = frame.object_points(1).astype(np.float64)
    return Verifier(np.random.default_rng(0).permutation(points), frame, TABLE)
