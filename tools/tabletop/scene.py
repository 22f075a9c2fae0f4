"""One scene from a seed and a number, written in the published layout."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brrp_cli.depth_noise.structured_light import add_depth_noise
from brrp_cli.errors import SceneError
from brrp_cli.files import atomic_folder
from brrp_cli.frames.published import depth_from_buffer, intrinsics_from_projection
from brrp_cli.seeds import child_rng
from tabletop.bin import Bin, draw_bin
from tabletop.camera import FAR, NEAR, Camera, Standpoint, draw_camera, gone_round
from tabletop.check import (
    CLEAN,
    STRUCTURED_LIGHT,
    Distance,
    check_measured_scene,
    check_scene,
)
from tabletop.furniture import Furniture, write_furniture
from tabletop.light import draw_light, relight
from tabletop.models import Model, load_model
from tabletop.platform import Platform, draw_platform
from tabletop.render import NOTHING, Picture, draw_look, render
from tabletop.robot import draw_robot
from tabletop.settle import Pose, drop
from tabletop.shelf import Shelf, draw_shelf
from tabletop.stack import stack
from tabletop.stage import Stage, stage_of
from tabletop.wall import draw_wall

FEWEST, MOST = 3, 10
MAX_DRAWS = 20
LIMITS = {"none": CLEAN, "structured-light": STRUCTURED_LIGHT}
LIGHTS = ("plain", "varied")
SENSOR_NAMES = ("none", "stereo", "xtion", "kinect-azure")
JPEG_QUALITY = 95
DARK_TABLE = 0.15  # how bright it is, of a usual one


@dataclass(frozen=True)
class Plan:
    """What all scenes of a set share. `noise`: a key of `LIMITS`; `light`: one of `LIGHTS`;
    `size`: (width, height); `sensor`: one of `SENSOR_NAMES`, instead of noise; `stacked`: every
    second object is dropped onto the one before it; `on_platform`: objects lie on a platform;
    `binned`: in a bin; `walled`: a wall stands behind them, as the first camera sees them;
    `shelved`: they stand in a shelf; `robot`: an arm reaches in over them, from a side on which
    the first camera is not; `dark_table`: it is black and shiny; `standpoint`: where
    cameras stand; `orbit`: degrees by which the camera goes round from one view to the next, 0:
    each stands anywhere."""

    meshes: tuple[Path, ...]
    data_root: Path
    output: Path
    seed: int
    views: int
    noise: str
    size: tuple[int, int]
    overwrite: bool
    light: str = "plain"
    sensor: str = "none"
    stacked: bool = False
    on_platform: bool = False
    binned: bool = False
    walled: bool = False
    shelved: bool = False
    robot: bool = False
    dark_table: bool = False
    standpoint: Standpoint = field(default_factory=Standpoint)
    orbit: float = 0.0


def check_depth(folder: Path, data_root: Path, noise: str, sensor: str) -> list[Distance]:
    """`check_scene`, or `check_measured_scene`, with what such depth allows."""
    if sensor == "none":
        return check_scene(folder, data_root, LIMITS[noise])
    return check_measured_scene(folder, data_root)


def make_scene(plan: Plan, number: int, check: bool) -> list[Distance]:
    """Write scene `number`; it depends on the plan's meshes and seed and on the number alone.

    Noise, sensor and light have random numbers of their own, so that a noisy or lit set shows the
    scenes of the clean one.

    Errors: SceneError if the check fails or no draw leaves enough objects on the table.
    """
    # Numbers of its own, so that other scenes stay as they are.
    bin = draw_bin(child_rng(plan.seed, "scene", number, "bin")) if plan.binned else None
    platform_rng = child_rng(plan.seed, "scene", number, "platform")
    platform = draw_platform(platform_rng) if plan.on_platform else None
    shelf = draw_shelf(child_rng(plan.seed, "scene", number, "shelf")) if plan.shelved else None
    paths, models, poses = draw_objects(
        plan.meshes, plan.seed, number, stacked=plan.stacked, holder=platform or bin or shelf
    )
    rng = child_rng(plan.seed, "scene", number, "views")
    look = draw_look(len(models), rng)
    if plan.dark_table:
        look = replace(look, table_color=DARK_TABLE * look.table_color)
    centers = [pose.apply(model.center[None])[0] for pose, model in zip(poses, models, strict=True)]
    center = np.mean(centers, axis=0)
    azimuth = (0.0, 2 * np.pi) if shelf is None else shelf.azimuth
    if plan.orbit:
        first = draw_camera(center, plan.size, rng, plan.standpoint, azimuth)
        cameras = [gone_round(first, center, plan.orbit * view) for view in range(plan.views)]
    else:
        cameras = [
            draw_camera(center, plan.size, rng, plan.standpoint, azimuth) for _ in range(plan.views)
        ]
    hulls = [
        pose.apply(model.hull + model.center) for pose, model in zip(poses, models, strict=True)
    ]
    furniture: Furniture | None = platform or bin
    if shelf is not None:
        furniture = shelf.over(np.concatenate(hulls))
    if plan.walled:
        wall_rng = child_rng(plan.seed, "scene", number, "wall")
        furniture = draw_wall(np.concatenate(hulls), cameras[0], wall_rng)
    if plan.robot:
        robot_rng = child_rng(plan.seed, "scene", number, "robot")
        furniture = draw_robot(np.concatenate(hulls), cameras[0], robot_rng)
    pictures = render(models, poses, look, cameras, plan.size, furniture)
    if plan.light == "varied":
        light_rng = child_rng(plan.seed, "scene", number, "light")
        light = draw_light(light_rng)
        pictures = [replace(p, rgb=relight(p.rgb, light, light_rng)) for p in pictures]
    folder = plan.output / f"{number:08d}"
    with atomic_folder(folder, overwrite=plan.overwrite, mark="objects.json") as partial:
        entries = [
            {
                "id": i + 1,
                "mesh_path": path.relative_to(plan.data_root).as_posix(),
                "position": pose.position.tolist(),
                "orientation": pose.orientation.tolist(),
                "scale": 1.0,
            }
            for i, (path, pose) in enumerate(zip(paths, poses, strict=True))
        ]
        (partial / "objects.json").write_text(json.dumps(entries, indent=2) + "\n")
        if isinstance(furniture, Platform | Bin | Shelf):
            write_furniture(furniture, partial)
        for i, (camera, picture) in enumerate(zip(cameras, pictures, strict=True)):
            depth = picture.depth
            if plan.noise != "none":
                noise_rng = child_rng(plan.seed, "scene", number, "noise", i)
                depth = noisy_buffer(depth, camera.projection, noise_rng)
            if plan.sensor != "none":
                K = intrinsics_from_projection(camera.projection, depth.shape)
                # The same materials in every view.
                material_rng = child_rng(plan.seed, "scene", number, "materials")
                stage = stage_of(
                    models,
                    poses,
                    look.object_colors,
                    camera,
                    K,
                    depth.shape,
                    material_rng,
                    furniture,
                    plan.dark_table,
                )
                depth = measured_buffer(
                    plan.sensor, stage, child_rng(plan.seed, "scene", number, "sensor", i)
                )
            write_view(partial / f"{i:04d}", picture, depth, camera)
        return check_depth(partial, plan.data_root, plan.noise, plan.sensor) if check else []


def draw_objects(
    meshes: tuple[Path, ...],
    seed: int,
    number: int,
    *,
    stacked: bool = False,
    holder: Platform | Bin | Shelf | None = None,
) -> tuple[list[Path], list[Model], list[Pose]]:
    """Three to ten objects that lie still on the table; drawn again until there are three.

    A mesh comes twice only where there are fewer meshes than objects.
    """
    place = stack if stacked else drop
    if holder is not None:
        place = partial(drop, panels=holder.around(), radius=holder.radius, ground=holder.ground)
    for attempt in range(MAX_DRAWS):
        rng = child_rng(seed, "scene", number, "objects", attempt)
        count = int(rng.integers(FEWEST, MOST + 1))
        order = np.concatenate(
            [rng.permutation(len(meshes)) for _ in range(-(-count // len(meshes)))]
        )
        paths = [meshes[i] for i in order[:count]]
        models = [load_model(path) for path in paths]
        kept = [
            (path, model, pose)
            for path, model, pose in zip(paths, models, place(models, rng), strict=True)
            if pose is not None
        ]
        if len(kept) >= FEWEST:
            return [k[0] for k in kept], [k[1] for k in kept], [k[2] for k in kept]
    raise SceneError(
        f"No draw leaves {FEWEST} objects at rest on the table",
        where=f"scene {number}, seed {seed}",
        found=f"{MAX_DRAWS} draws",
        fix="meshes must be in metres, and smaller than the table (1.5 m)",
    )


def noisy_buffer(
    buffer: NDArray[np.float32], projection: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float32]:
    """The depth buffer of a structured-light camera; a pixel without return is on the far plane."""
    clean = np.nan_to_num(depth_from_buffer(buffer, projection))
    K = intrinsics_from_projection(projection, buffer.shape)
    return buffer_from_depth(add_depth_noise(clean, K, rng).astype(np.float64))


def measured_buffer(sensor: str, stage: Stage, rng: np.random.Generator) -> NDArray[np.float32]:
    """The depth buffer that a camera of `SENSOR_NAMES` would write of a stage."""
    # OpenCV is needed for these only.
    from tabletop.sensors import SENSORS

    return buffer_from_depth(SENSORS[sensor](stage, rng))


def buffer_from_depth(depth: NDArray[np.float64]) -> NDArray[np.float32]:
    """Depth (H, W), metres, as a depth buffer; a pixel without return is on the far plane."""
    returned = depth > NEAR
    noisy = FAR / (FAR - NEAR) * (1 - NEAR / np.where(returned, depth, 1.0))
    return np.where(returned & (noisy < 1), noisy, NOTHING).astype(np.float32)


def write_view(folder: Path, picture: Picture, depth: NDArray[np.float32], camera: Camera) -> None:
    """One view in the published layout."""
    from PIL import Image

    folder.mkdir()
    Image.fromarray(picture.rgb).save(folder / "rgb.jpg", quality=JPEG_QUALITY)
    np.save(folder / "depth.npy", depth)
    np.save(folder / "seg_mask.npy", picture.ids)
    np.savez(folder / "camera.npz", projection_matrix=camera.projection, view_matrix=camera.view)
