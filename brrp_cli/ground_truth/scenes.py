"""Scenes with ground truth, read from disk.

Two layouts, which may stand side by side in one folder (and BOP's data sets, see bop_scenes):

- the published one: a folder for each scene with `objects.json` and one folder for each view
  (`rgb.jpg`, `depth.npy`, `camera.npz`, `seg_mask.npy`);
- `NAME.npz`, a frame file with `T_world_cam`, and `NAME.truth.json` beside it, which holds the same
  list of objects as `objects.json`.

Poses are in the world frame of the views' `T_world_cam`.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from brrp_cli.errors import FrameError, SceneError
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.frames.npz import load_frame
from brrp_cli.frames.published import read_published
from brrp_cli.ground_truth.truth import TrueObject, read_objects, true_mesh, true_mesh_in_camera

__all__ = ["Scene", "TrueObject", "find_scenes", "true_mesh", "true_mesh_in_camera"]

OBJECTS_FILE = "objects.json"
TRUTH_SUFFIX = ".truth.json"

log = logging.getLogger(__name__)

T = TypeVar("T")


@dataclass(frozen=True)
class Scene:
    """True objects and the frames that show them. `folder` is the file itself for `NAME.npz`."""

    name: str
    folder: Path
    objects: tuple[TrueObject, ...]
    views: tuple[Path, ...]

    def view(self, index: int) -> Frame:
        """Frame number `index`; mask ids that are no object's (a simulator numbers the table too)
        become background.

        Errors: FrameError for a bad frame or one without a camera pose; SceneError if there is no
        such view or if not one id of the mask is an object's.
        """
        if not 0 <= index < len(self.views):
            raise SceneError(
                "The scene has no such view",
                where=self.folder,
                expected=f"0 to {len(self.views) - 1}",
                found=index,
            )
        path = self.views[index]
        frame = self.read(path)
        if frame.T_world_cam is None:
            raise FrameError(
                "The frame has no camera pose, so that the true objects cannot be placed in it",
                where=path,
                expected="T_world_cam, (4, 4)",
                found="none",
            )
        return self._keep_known_ids(frame)

    def read(self, path: Path) -> Frame:
        """The frame of one of `views`. Errors: FrameError."""
        if path.is_dir():
            return read_published(path)
        return load_frame(path, background_told=True)  # the true objects' ids tell it

    def _keep_known_ids(self, frame: Frame) -> Frame:
        known = [o.id for o in self.objects]
        strangers = [i for i in frame.object_ids if i not in known]
        if len(strangers) == len(frame.object_ids):
            raise SceneError(
                "No id of the mask is an object's",
                where=frame.source,
                expected=f"ids of the true objects: {known}",
                found=frame.object_ids or "background only",
                fix="masks and true objects must come from one scene",
            )
        if not strangers:
            return frame
        log.info("%s: ids %s are no object's, taken as background", frame.source, strangers)
        segmap = np.where(np.isin(frame.segmap, known), frame.segmap, BACKGROUND)
        return frame.with_masks(segmap)

    def object(self, object_id: int) -> TrueObject:
        """The true object of that id."""
        for candidate in self.objects:
            if candidate.id == object_id:
                return candidate
        raise SceneError(
            "The scene has no object of that id",
            where=self.folder,
            expected=[o.id for o in self.objects],
            found=object_id,
        )


def find_scenes(folder: Path, select: slice | None = None) -> list[Scene]:
    """The scenes of a folder, by name, cut by `select`; a scene's own folder or file also serves.

    Errors: SceneError if there are none, if the selection is empty, or if a truth file is bad.
    """
    paths = _scene_paths(folder)
    if not paths:
        # It makes scenes of the kind that is defined here.
        from brrp_cli.ground_truth.bop_scenes import bop_scenes

        if found := bop_scenes(folder):
            return [*_chosen(found, select, folder)]
    if not paths:
        raise SceneError(
            "No scene found",
            where=folder,
            expected=f"folders with {OBJECTS_FILE}, NAME.npz with NAME{TRUTH_SUFFIX} beside it, or"
            " a BOP data set",
            found=_listing(folder),
            fix="name the folder that holds the scenes; tools/make_scenes.py makes some",
        )
    return [_read_scene(path) for path in _chosen(paths, select, folder)]


def _chosen(items: Sequence[T], select: slice | None, folder: Path) -> list[T]:
    chosen = list(items[select or slice(None)])
    if not chosen and select is not None:
        raise SceneError(
            "The selection holds no scene",
            where=folder,
            expected=f"a part of 0:{len(items)}",
            found=f"{select.start}:{select.stop}",
        )
    return chosen


def _scene_paths(folder: Path) -> list[Path]:
    if folder.is_file():
        return [folder] if _truth_of(folder).is_file() else []
    if (folder / OBJECTS_FILE).is_file():
        return [folder]
    if not folder.is_dir():
        return []
    return sorted(
        path
        for path in folder.iterdir()
        if not path.name.startswith(".")
        and (
            (path / OBJECTS_FILE).is_file() or (path.suffix == ".npz" and _truth_of(path).is_file())
        )
    )


def _truth_of(frame_file: Path) -> Path:
    return frame_file.with_name(frame_file.stem + TRUTH_SUFFIX)


def _listing(folder: Path) -> str:
    if not folder.is_dir():
        return "no such folder"
    names = sorted(path.name for path in folder.iterdir())
    return (
        ", ".join(names[:5]) + (", ..." if len(names) > 5 else "") if names else "an empty folder"
    )


def _read_scene(path: Path) -> Scene:
    if path.is_file():
        return Scene(path.stem, path, tuple(read_objects(_truth_of(path))), (path,))
    views = sorted(
        view for view in path.iterdir() if view.is_dir() and not view.name.startswith(".")
    )
    if not views:
        raise SceneError(
            "The scene has no views",
            where=path,
            expected="a folder for each view: 0000/, 0001/, ...",
        )
    return Scene(path.name, path, tuple(read_objects(path / OBJECTS_FILE)), tuple(views))
