"""Affinities of pixels, by the networks that come with the package.

`tools/train_masks.py` trains them; docs/frames-and-masks.md says on what.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.errors import WeightsError
from brrp_cli.frames.dilate import mask_box
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.last_frame import kept_for_last_image
from brrp_cli.learned_models import OnnxModel
from brrp_cli.segmentation.image_channels import (
    COLOURS,
    WHOLE,
    image_channels,
    resized,
    size_of,
)
from brrp_cli.segmentation.pixel_pairs import OFFSETS
from brrp_cli.segmentation.rising import rising_in
from brrp_cli.segmentation.seen_surfaces import SeenSurfaces
from brrp_cli.threads import cores, in_threads

T = TypeVar("T", bound=np.generic)

# In the file's metadata, beside `network` and `training`, which are JSON.
FORMAT = "brrp affinities 3"
WHAT = "the network that parts objects"
# Of tables, and of what lies in a bin, in a shelf, before a wall or on a platform, which the former
# never saw.
NAME, WALLED_NAME = "affinities.onnx", "affinities_walled.onnx"
CHANNELS_IN, PROBABILITIES_OUT = "channels", "probabilities"


class AffinityModel:
    """The network of a file, which threads may ask at the same time.

    Errors: WeightsError if the file is missing, damaged or of another kind.
    """

    def __init__(self, path: Path) -> None:
        # A thread for each question: more would change the last bits.
        self._model = OnnxModel(path, WHAT, WeightsError, "install brrp-cli again", threads=1)
        found = self._model.metadata.get("format")
        if found != FORMAT:
            raise self._model.error("cannot be read", found, expected=FORMAT)

    def __call__(self, channels: NDArray[np.float32]) -> NDArray[np.float32]:
        """Probabilities (len(OFFSETS) + 1, h, w) from channels (CHANNELS, h, w): affinities, and at
        last that the pixel shows an object."""
        (found,) = self._model.run([PROBABILITIES_OUT], {CHANNELS_IN: channels[None]})
        return np.asarray(found[0])


@dataclass(frozen=True)
class Affinities:
    """What the network says of an image (H, W) that it saw as one of (h, w) pixels.

    same : (K, h, w) probability that a pixel and the one `offsets` (K, 2) from it show one object;
    object : (h, w) that it shows one
    """

    same: NDArray[np.float32]
    object: NDArray[np.float32]
    offsets: tuple[tuple[int, int], ...]
    shape: tuple[int, int]

    def sample(self, values: NDArray[T]) -> NDArray[T]:
        """(h, w) of (H, W)."""
        return resized(values, (self.object.shape[0], self.object.shape[1]))

    def restore(self, values: NDArray[T]) -> NDArray[T]:
        """(H, W) of (h, w)."""
        return resized(values, self.shape)


@kept_for_last_image
def affinities_in(frame: Frame, seen: SeenSurfaces, config: SegmentConfig) -> Affinities:
    """What the network that comes with the package says of a frame and the surfaces seen in it, of
    what rises and what is near it. Where there is more than a table, it is the network that knows
    walls."""
    risen = rising_in(frame, seen, config).risen
    own = config.affinities
    network = shipped(WALLED_NAME if seen.table.furnished else NAME)
    return affinities_of(frame.rgb, seen, network, own.colour, risen, own.margin)


def affinities_of(
    rgb: NDArray[np.uint8],
    seen: SeenSurfaces,
    network: AffinityModel,
    colour: float = 1.0,
    asked: NDArray[np.bool_] | None = None,
    margin: int = 0,
) -> Affinities:
    """What the network says of colours (H, W, 3) and the surfaces that were seen.

    colour : what it says so counts so much, and the rest what it says where all colours are one
    asked : (H, W) of the box around these pixels, and of `margin` pixels of its own image
        beyond it; 0 elsewhere. None = of the whole image
    """
    size = size_of(rgb.shape[:2])
    box = WHOLE if asked is None else mask_box(resized(asked, size), margin)
    values = image_channels(rgb, seen, box).astype(np.float32) / np.float32(63)
    blind = values.copy()
    blind[COLOURS] = 0
    looks = [(look, w) for look, w in ((values, colour), (blind, 1 - colour)) if w > 0]

    def say(look: tuple[NDArray[np.float32], float]) -> NDArray[np.float32]:
        return np.float32(look[1]) * network(look[0])

    found = np.zeros((len(OFFSETS) + 1, *size), np.float32)
    if values.size:
        for said in in_threads(say, looks, cores()):
            found[:, *box] += said
    return Affinities(found[:-1], found[-1], OFFSETS, (rgb.shape[0], rgb.shape[1]))


@cache
def shipped(name: str = NAME) -> AffinityModel:
    """A network that comes with the package, `NAME` or `WALLED_NAME`."""
    with as_file(files("brrp_cli.segmentation") / name) as path:
        return AffinityModel(path)
