"""Examples of objects that are to be told apart, made from scenes once and kept as .npz.

One file for each view of a scene, SET/NAME_VIEW.npz:

    channels  (CHANNELS, h, w) int8, of brrp_cli/segmentation/image_channels.py
    labels    (h, w) uint8, the object that each pixel shows, 0 = background
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.errors import BrrpError, FrameError
from brrp_cli.files import write_bytes
from brrp_cli.ground_truth.scenes import Scene
from brrp_cli.seeds import child_rng
from brrp_cli.segmentation.image_channels import CHANNELS, image_channels, resized
from brrp_cli.segmentation.seen_surfaces import see_surfaces
from training.completion_examples import through_a_sensor


@dataclass(frozen=True)
class Examples:
    """As the files hold them: channels (N, CHANNELS, h, w), labels (N, h, w), names (N,) of the
    views."""

    channels: NDArray[np.int8]
    labels: NDArray[np.uint8]
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.labels)


@dataclass(frozen=True)
class Wanted:
    """A view of a scene, and whether its depth is a camera's already."""

    scene: Scene
    view: int
    measured: bool = False

    @property
    def name(self) -> str:
        """The example's file, in the folder of all."""
        return f"{self.scene.folder.parent.name}/{self.scene.name}_{self.view}.npz"


def make_view(wanted: Wanted, seed: int, folder: Path) -> Path:
    """Write what is missing of a view's example, whole or not at all; a view in which no table is
    found has an empty file."""
    path = folder / wanted.name
    if path.exists():
        return path
    scene = wanted.scene
    frame = scene.view(wanted.view)
    if not wanted.measured:
        rng = child_rng(seed, scene.folder.parent.name, scene.name, wanted.view)
        frame = through_a_sensor(frame, rng)
    try:
        channels = image_channels(frame.rgb, see_surfaces(frame, seed, SegmentConfig()))
    except FrameError:
        channels = np.zeros((CHANNELS, 0, 0), np.int8)
    labels = resized(frame.segmap, (channels.shape[1], channels.shape[2]))
    # 0 and then 1, 2, ...: ids may be of any size.
    ids = np.unique(labels[labels > 0])
    labels = np.where(labels > 0, np.searchsorted(ids, labels) + 1, 0).astype(np.uint8)
    buffer = BytesIO()
    np.savez_compressed(buffer, channels=channels, labels=labels)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, buffer.getvalue())
    return path


def make_all(every: Sequence[Wanted], seed: int, folder: Path, workers: int) -> Iterator[Path]:
    """Write what is missing of the examples of these views into `folder`; yields each one's
    file."""
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        yield from pool.map(partial(make_view, seed=seed, folder=folder), every, chunksize=4)


def read_examples(paths: Sequence[Path]) -> Examples:
    """The examples of all files that are not empty. Errors: BrrpError if their sizes differ."""
    channels, labels, names = [], [], []
    for path in paths:
        with np.load(path, allow_pickle=False) as file:
            if not file["labels"].size:
                continue
            if labels and file["labels"].shape != labels[0].shape:
                raise BrrpError(
                    "Views of two sizes cannot be trained on together",
                    where=path,
                    expected=f"rows and columns {labels[0].shape}, as of the first",
                    found=file["labels"].shape,
                    fix="make all scenes at one size, and the examples anew",
                )
            channels.append(file["channels"])
            labels.append(file["labels"])
            names.append(f"{path.parent.name}/{path.stem}")
    if not labels:
        return Examples(np.empty((0, CHANNELS, 0, 0), np.int8), np.empty((0, 0, 0), np.uint8), ())
    return Examples(np.stack(channels), np.stack(labels), tuple(names))


def is_held(path: Path, share: float, seed: int) -> bool:
    """Whether a view is kept to validate, with all views of its scene."""
    scene = path.stem.rpartition("_")[0]
    return bool(child_rng(seed, "validation", path.parent.name, scene).random() < share)
