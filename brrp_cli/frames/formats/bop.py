"""BOP data sets: a scene folder with scene_camera.json, rgb/ or gray/, depth/ and mask_visib/.

Layout and units: docs/bop_datasets_format.md of thodan/bop_toolkit. cam_K in pixels; raw depth x
depth_scale = millimetres; cam_t_w2c in millimetres; masks IMAGE_INSTANCE.png, one for each entry
of scene_gt.json.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import FrameError
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.format import Format, Request, pick
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.pixels import read_colour, read_depth, read_masks

CAMERA, TRUTH = "scene_camera.json", "scene_gt.json"
MILLIMETRE = 0.001
_COLOURS = ("rgb", "gray")
_ENDINGS = (".png", ".jpg", ".tif", ".tiff")


def read_table(path: Path) -> dict[int, Any]:
    """One of a scene's JSON files: image number -> entry. Errors: FrameError."""
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        return {int(image): entry for image, entry in table.items()}
    except (OSError, ValueError, AttributeError) as error:
        raise FrameError(
            "The scene's file cannot be read",
            where=path,
            expected="JSON: image number -> its entry, as BOP writes it",
            found=f"{type(error).__name__}: {error}",
        ) from error


def rigid(entry: dict[str, Any], rotation: str, translation: str, where: object) -> NDArray[Any]:
    """(4, 4), metres, of a rotation (9 numbers, row by row) and a translation in millimetres."""
    T = np.eye(4)
    try:
        T[:3, :3] = np.reshape(np.array(entry[rotation], dtype=np.float64), (3, 3))
        T[:3, 3] = np.reshape(np.array(entry[translation], dtype=np.float64), 3) * MILLIMETRE
    except (KeyError, TypeError, ValueError) as error:
        raise FrameError(
            "A pose cannot be read",
            where=where,
            expected=f"{rotation} (9 numbers) and {translation} (3 numbers, millimetres)",
            found=f"{type(error).__name__}: {error}",
        ) from error
    return T


def read_image(folder: Path, image: int) -> Frame:
    """Image number `image` of a scene folder. Mask ids are 1 + the place in scene_gt.json.

    `T_world_cam` is there where the data set tells the camera's pose. Errors: FrameError.
    """
    cameras = read_table(folder / CAMERA)
    where = f"{folder / CAMERA}: {image}"
    camera = cameras.get(image)
    if not isinstance(camera, dict) or "cam_K" not in camera:
        raise FrameError("The image has no camera", where=where, expected="cam_K", found=camera)
    if "depth_scale" not in camera:
        raise FrameError("The image has no depth_scale", where=where, found=", ".join(camera))
    K = np.array(camera["cam_K"], dtype=np.float64)
    if K.size != 9:
        raise FrameError("cam_K is no matrix", where=where, expected="9 numbers", found=K.size)
    T_world_cam = None
    if "cam_R_w2c" in camera and "cam_t_w2c" in camera:
        T_world_cam = np.linalg.inv(rigid(camera, "cam_R_w2c", "cam_t_w2c", where))
    return make_frame(
        read_colour(_image_file(folder, _COLOURS, image)),
        _masks(folder, image),
        depth=read_depth(_image_file(folder, ("depth",), image)),
        K=K.reshape(3, 3),
        T_world_cam=T_world_cam,
        depth_scale=float(camera["depth_scale"]) * MILLIMETRE,
        source=folder / f"{image:06d}",
    )


def _image_file(folder: Path, kinds: tuple[str, ...], image: int) -> Path:
    names = [folder / kind / f"{image:06d}{ending}" for kind in kinds for ending in _ENDINGS]
    for path in names:
        if path.is_file():
            return path
    raise FrameError(
        "The image's file is missing",
        where=folder,
        expected=" or ".join(f"{kind}/{image:06d}.png" for kind in kinds),
        fix="unpack the data set's images too",
    )


def _masks(folder: Path, image: int) -> NDArray[np.int64] | None:
    """Ids (H, W) of the visible parts; None where the data set has no masks."""
    files = sorted((folder / "mask_visib").glob(f"{image:06d}_*.png"))
    ids: NDArray[np.int64] | None = None
    for path in files:
        visible = read_masks(path) > 0
        if ids is None:
            ids = np.zeros(visible.shape, np.int64)
        if visible.shape != ids.shape:
            raise FrameError(
                "The masks differ in size",
                where=path,
                expected=ids.shape,
                found=visible.shape,
            )
        ids[visible] = 1 + int(path.stem.partition("_")[2])
    return ids


def scene_folders(path: Path) -> list[Path]:
    """The scenes of a scene folder, a split (test/) or a data set, by name."""
    for pattern in (CAMERA, f"*/{CAMERA}", f"*/*/{CAMERA}"):
        found = sorted(file.parent for file in path.glob(pattern))
        if found:
            return found
    return []


def read(path: Path, request: Request) -> Frame:
    """The image that `--index` names: SCENE/IMAGE, or IMAGE in a scene's folder; the first one
    else. Errors: FrameError."""
    why = "BOP's scene_camera.json, which tells both"
    request.refuse(path, why, depth_scale="--depth-scale", intrinsics="--intrinsics")
    scenes = scene_folders(path)
    index = request.index
    scene = scenes[0]
    if index is not None and "/" in index:
        name, _, index = index.partition("/")
        scene = pick(scenes, name, [folder.name for folder in scenes], path)
    images = sorted(read_table(scene / CAMERA))
    # Images go by the number that they have, not by their place.
    names = [str(image) for image in images]
    if index is not None and index.isdigit() and str(int(index)) not in names:
        raise FrameError(
            "The scene has no such image",
            where=scene,
            expected=", ".join(names[:8]) + (", ..." if len(names) > 8 else ""),
            found=index,
        )
    chosen = pick(images, None if index is None else str(int(index)), names, scene)
    return read_image(scene, chosen)


FORMAT = Format(
    title="a BOP data set",
    layout="scene_camera.json, rgb/ or gray/, depth/, here or one or two folders below",
    matches=lambda path: path.is_dir() and bool(scene_folders(path)),
    read=read,
)
