"""A made tabletop frame with known truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrp_cli.demo.layout import camera_pose, stand_apart
from brrp_cli.depth_noise.structured_light import add_depth_noise
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.frame import Frame
from brrp_cli.raycast import Sight, look
from brrp_cli.seeds import child_rng
from brrp_cli.shapes import solids
from brrp_cli.shapes.household import Shape, household_shapes, household_variations

if TYPE_CHECKING:
    import trimesh

STORED, VARIED = 4, 1  # objects of the starter prior, and objects in sizes that it does not hold
SHAPE = (480, 640)
INTRINSICS = np.array([[610.0, 0.0, 319.5], [0.0, 610.0, 239.5], [0.0, 0.0, 1.0]])
TARGET = np.array([0.0, 0.0, 0.06])
MIN_VISIBLE = 0.5  # share of each object's silhouette that nothing hides
TABLE_COLOUR, FLOOR_COLOUR = (186, 168, 146), (110, 112, 116)
LIGHT_WORLD = np.array([0.35, 0.2, 0.9]) / np.linalg.norm([0.35, 0.2, 0.9])
AMBIENT = 0.4


@dataclass(frozen=True)
class DemoScene:
    """A frame and what is truly there.

    truth : object id -> closed mesh, metres, camera frame; names : object id -> shape's name
    """

    frame: Frame
    truth: dict[int, trimesh.Trimesh]
    names: dict[int, str]


def make_scene(seed: int) -> DemoScene:
    """Four objects of the starter prior and one of another size on a table, seen with the noise of
    a structured-light camera. The same seed gives the same bytes.
    """
    rng = child_rng(seed, "demo scene")
    shapes = _choose(rng)
    while True:
        poses = stand_apart([shape.mesh for shape in shapes], rng)
        T_world_cam = camera_pose(
            TARGET,
            distance=rng.uniform(0.8, 1.0),
            pitch=np.deg2rad(rng.uniform(35, 45)),
            yaw=rng.uniform(0, 2 * np.pi),
        )
        if poses is None:
            continue
        T_cam_world = np.linalg.inv(T_world_cam)
        meshes = [
            shape.mesh.copy().apply_transform(T_cam_world @ pose)
            for shape, pose in zip(shapes, poses, strict=True)
        ]
        room = [part.apply_transform(T_cam_world) for part in _room()]
        sight = look([*meshes, *room], INTRINSICS, SHAPE)
        if well_seen(meshes, sight):
            break
    colours = [*(shape.color for shape in shapes), TABLE_COLOUR, FLOOR_COLOUR]
    ids = np.where((sight.index >= 0) & (sight.index < len(meshes)), sight.index + 1, 0)
    frame = make_frame(
        rgb=shade(sight, colours, T_cam_world[:3, :3] @ LIGHT_WORLD),
        segmap=ids,
        depth=add_depth_noise(sight.depth, INTRINSICS, child_rng(seed, "demo noise")),
        K=INTRINSICS,
        T_world_cam=T_world_cam,
    )
    return DemoScene(
        frame=frame,
        truth={i + 1: mesh for i, mesh in enumerate(meshes)},
        names={i + 1: shape.name for i, shape in enumerate(shapes)},
    )


def well_seen(meshes: Sequence[trimesh.Trimesh], sight: Sight) -> bool:
    """Whether each mesh lies inside the image and is hidden by others at most in half."""
    for i, mesh in enumerate(meshes):
        alone = look([mesh], INTRINSICS, SHAPE).index == 0
        border = np.concatenate([alone[0], alone[-1], alone[:, 0], alone[:, -1]])
        visible = np.count_nonzero(sight.index == i)
        if border.any() or visible < MIN_VISIBLE * np.count_nonzero(alone):
            return False
    return True


def shade(
    sight: Sight, colours: Sequence[tuple[int, int, int]], light: NDArray[np.floating]
) -> NDArray[np.uint8]:
    """Lambert shading (H, W, 3): mesh i has colours[i]; `light` (3,) points to the light."""
    brightness = AMBIENT + (1 - AMBIENT) * np.clip(sight.normals @ light, 0, 1)
    palette = np.array([*colours, (0, 0, 0)], dtype=np.float64)
    return np.asarray(np.rint(palette[sight.index] * brightness[..., None]), dtype=np.uint8)


def _choose(rng: np.random.Generator) -> list[Shape]:
    stored, varied = household_shapes(), household_variations()
    return [
        *(stored[i] for i in rng.choice(len(stored), STORED, replace=False)),
        *(varied[i] for i in rng.choice(len(varied), VARIED, replace=False)),
    ]


def _room() -> list[trimesh.Trimesh]:
    """A table top at z = 0 and a floor, world frame."""
    return [
        solids.moved(solids.box(1.4, 1.2, 0.03), z=-0.03),
        solids.moved(solids.box(8.0, 8.0, 0.02), z=-0.75),
    ]
