"""BOP data sets: a scene folder with scene_camera.json, rgb/ or gray/, depth/ and mask_visib/.

Layout and units: docs/bop_datasets_format.md of thodan/bop_toolkit. cam_K in pixels; raw depth x
depth_scale = millimetres; cam_t_w2c in millimetres; masks IMAGE_INSTANCE.png, one for each entry
of scene_gt.json.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import FrameError
from brrp_cli.files import parse_json, trouble_of
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.format import Format, FrameRequest, as_number, pick
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.pixels import read_colour, read_depth, read_masks

CAMERA, TRUTH = "scene_camera.json", "scene_gt.json"
MILLIMETRE = 0.001
_COLOURS = ("rgb", "gray")
_TURNED = 1e-2  # of R R^T: data sets round their rotations
_ENDINGS = (".png", ".jpg", ".tif", ".tiff")


def read_table(path: Path) -> dict[int, Any]:
    """One of a scene's JSON files: image number -> entry. Errors: FrameError."""
    try:
        table = parse_json(path.read_text(encoding="utf-8"))
        return {_number(image): entry for image, entry in table.items()}
    except (OSError, ValueError, AttributeError) as error:
        raise FrameError(
            "The scene's file cannot be read",
            where=path,
            expected="JSON: image number -> its entry, as BOP writes it",
            found=trouble_of(error),
        ) from error


def _number(text: str) -> int:
    """Image numbers are part of file names. Errors: ValueError."""
    if not re.fullmatch(r"[0-9]{1,18}", text):
        raise ValueError(f"{text[:20]!r} is no image's number")
    return int(text)


def rigid(entry: dict[str, Any], rotation: str, translation: str, where: object) -> NDArray[Any]:
    """(4, 4), metres, of a rotation (9 numbers, row by row) and a translation in millimetres.

    Errors: FrameError, also where it is no rotation.
    """
    T = np.eye(4)
    try:
        T[:3, :3] = np.reshape(np.array(entry[rotation], dtype=np.float64), (3, 3))
        T[:3, 3] = np.reshape(np.array(entry[translation], dtype=np.float64), 3) * MILLIMETRE
        turned = T[:3, :3] @ T[:3, :3].T
        if not (np.isfinite(T).all() and np.allclose(turned, np.eye(3), atol=_TURNED)):
            raise ValueError("a matrix that turns nothing, or not alone")
    except (KeyError, TypeError, ValueError) as error:
        raise FrameError(
            "A pose cannot be read",
            where=where,
            expected=f"{rotation} (9 numbers) and {translation} (3 numbers, millimetres)",
            found=trouble_of(error),
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
    try:
        K = np.reshape(np.array(camera["cam_K"], dtype=np.float64), (3, 3))
        millimetres = float(camera["depth_scale"])
    except (TypeError, ValueError) as error:
        raise FrameError(
            "The image's camera cannot be read",
            where=where,
            expected="cam_K, 9 numbers; depth_scale, a number",
            found=trouble_of(error),
        ) from error
    T_world_cam = None
    if "cam_R_w2c" in camera and "cam_t_w2c" in camera:
        T_world_cam = np.linalg.inv(rigid(camera, "cam_R_w2c", "cam_t_w2c", where))
    return make_frame(
        rgb=read_colour(_image_file(folder, _COLOURS, image)),
        segmap=_masks(folder, image),
        depth=read_depth(_image_file(folder, ("depth",), image)),
        K=K,
        T_world_cam=T_world_cam,
        depth_scale=millimetres * MILLIMETRE,
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
    ids: NDArray[np.int64] | None = None
    for (_, instance), path in sorted(mask_files(folder, image).items()):
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
        ids[visible] = 1 + instance
    return ids


def mask_files(folder: Path, image: int | None = None) -> dict[tuple[int, int], Path]:
    """(image, instance) -> file of the visible masks, of one image or of all. Errors: FrameError
    for a name that tells no numbers."""
    pattern = "*_*.png" if image is None else f"{image:06d}_*.png"
    found = {}
    for path in (folder / "mask_visib").glob(pattern):
        numbers = re.fullmatch(r"([0-9]{1,18})_([0-9]{1,9})", path.stem)
        if numbers is None:
            raise FrameError(
                "A mask's name tells no numbers", where=path, expected="IMAGE_INSTANCE.png"
            )
        found[int(numbers[1]), int(numbers[2])] = path
    return found


def scene_folders(path: Path) -> list[Path]:
    """The scenes of a scene folder, a split (test/) or a data set, by name."""
    for pattern in (CAMERA, f"*/{CAMERA}", f"*/*/{CAMERA}"):
        found = sorted(file.parent for file in path.glob(pattern))
        if found:
            return found
    return []


def read(path: Path, request: FrameRequest) -> Frame:
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
    number = None if index is None else str(as_number(index))
    if number is not None and number not in names:
        raise FrameError(
            "The scene has no such image",
            where=scene,
            expected=", ".join(names[:8]) + (", ..." if len(names) > 8 else ""),
            found=index,
        )
    return read_image(scene, pick(images, number, names, scene))


def names(path: Path, request: FrameRequest) -> list[str]:
    """SCENE/IMAGE of every image, or IMAGE in a scene's folder. Errors: FrameError."""
    found = []
    for scene in scene_folders(path):
        above = "" if scene == path else f"{scene.name}/"
        found += [f"{above}{image}" for image in sorted(read_table(scene / CAMERA))]
    return found


FORMAT = Format(
    title="a BOP data set",
    layout="scene_camera.json, rgb/ or gray/, depth/, here or one or two folders below",
    matches=lambda path: path.is_dir() and bool(scene_folders(path)),
    read=read,
    names=names,
)
