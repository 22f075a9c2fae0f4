"""BOP data sets as scenes with truth: every image with masks is a scene of one view.

The poses of scene_gt.json are in the camera's frame, so that is the world here. Models and
translations are in millimetres.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from brrp_cli.errors import SceneError
from brrp_cli.frames.formats.bop import (
    MILLIMETRE,
    TRUTH,
    mask_files,
    read_image,
    read_table,
    rigid,
    scene_folders,
)
from brrp_cli.frames.frame import Frame
from brrp_cli.ground_truth.scenes import Scene
from brrp_cli.ground_truth.truth import TrueObject
from brrp_cli.spoken import kind_of

# Some data sets have models of several kinds; the plain ones are what was scanned.
_MODELS = ("models", "models_reconst", "models_cad", "models_eval")


@dataclass(frozen=True)
class BopScene(Scene):
    """One image; `folder` is its scene's."""

    image: int = 0

    def read(self, path: Path) -> Frame:
        """The image with its visible masks; the world is the camera. Errors: FrameError."""
        return replace(read_image(path, self.image), T_world_cam=np.eye(4))


def bop_scenes(path: Path) -> list[BopScene]:
    """The images of a scene, a split or a data set that have true poses and visible masks, by name:
    SCENE_IMAGE.

    Errors: SceneError if scene_gt.json is bad or no models lie above the scenes.
    """
    folders = scene_folders(path) if path.is_dir() else []
    return [scene for folder in folders for scene in _images(folder)]


def _images(folder: Path) -> list[BopScene]:
    masked = {image for image, _ in mask_files(folder)}
    if not masked or not (folder / TRUTH).is_file():
        return []
    truth = read_table(folder / TRUTH)
    models = _models(folder)
    return [
        BopScene(
            name=f"{folder.name}_{image:06d}",
            folder=folder,
            objects=tuple(
                _object(entry, place, models, f"{folder / TRUTH}: {image}, entry {place}")
                for place, entry in enumerate(_entries(truth[image], f"{folder / TRUTH}: {image}"))
            ),
            views=(folder,),
            image=image,
        )
        for image in sorted(masked & set(truth))
    ]


def _entries(found: object, where: str) -> list[object]:
    if not isinstance(found, list):
        raise SceneError(
            "Not a list of objects", where=where, expected="a list", found=kind_of(found)
        )
    return found


def _object(entry: object, place: int, models: str, where: str) -> TrueObject:
    if not isinstance(entry, dict) or type(entry.get("obj_id")) is not int or entry["obj_id"] < 0:
        raise SceneError("Bad true object", where=where, expected="obj_id and a pose", found=entry)
    return TrueObject(
        id=1 + place,
        mesh_path=f"{models}/obj_{entry['obj_id']:06d}.ply",
        T_world_object=rigid(entry, "cam_R_m2c", "cam_t_m2c", where),
        unit=MILLIMETRE,
    )


def _models(folder: Path) -> str:
    """The folder of models, relative to the data set. Errors: SceneError."""
    for root in folder.resolve().parents[:3]:
        for name in _MODELS:
            if (root / name).is_dir():
                return name
    raise SceneError(
        "The data set's models are not there",
        where=folder,
        expected=f"{' or '.join(_MODELS)} beside the split's folder",
        fix="unpack the data set's models archive too",
    )
