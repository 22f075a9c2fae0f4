"""Affinities of pixels, by the network that comes with the package.

`tools/train_masks.py` trains it and says on what; brrp_cli/segmentation/affinities.safetensors
holds it (network_files.py).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.last_frame import kept_for_last_image
from brrp_cli.network_files import load_network, save_network
from brrp_cli.segmentation.image_channels import (
    COLOURS,
    WHOLE,
    image_channels,
    resized,
    size_of,
)
from brrp_cli.segmentation.pixel_pairs import box_of
from brrp_cli.segmentation.rising import rising_in
from brrp_cli.segmentation.seen_surfaces import SeenSurfaces
from brrp_cli.threads import cores, in_threads

if TYPE_CHECKING:
    from torch import Tensor

    from brrp_cli.segmentation.affinity_network import AffinityNetwork

T = TypeVar("T", bound=np.generic)

# Of networks that saw the image at full size, and before, at half of it alone.
FORMATS = "brrp affinities 2", "brrp affinities 1"
FORMAT = FORMATS[0]
WHAT = "the network that parts objects"
NAME = "affinities.safetensors"


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
    what rises and what is near it."""
    risen = rising_in(frame, seen, config).risen
    own = config.affinities
    return affinities_of(frame.rgb, seen, shipped(), own.colour, risen, own.margin)


def affinities_of(
    rgb: NDArray[np.uint8],
    seen: SeenSurfaces,
    network: AffinityNetwork,
    colour: float = 1.0,
    asked: NDArray[np.bool_] | None = None,
    margin: int = 0,
) -> Affinities:
    """What the network says of colours (H, W, 3) and the surfaces that were seen.

    colour : what it says so counts so much, and the rest what it says where all colours are one
    asked : (H, W) of the box around these pixels, and of `margin` pixels of its own image
        beyond it; 0 elsewhere. None = of the whole image
    """
    import torch

    from brrp_cli.segmentation.affinity_network import OFFSETS

    size = size_of(rgb.shape[:2])
    box = WHOLE if asked is None else box_of(resized(asked, size), margin)
    values = torch.from_numpy(image_channels(rgb, seen, box)).float() / 63
    blind = values.clone()
    blind[COLOURS] = 0
    looks = [(look, w) for look, w in ((values, colour), (blind, 1 - colour)) if w > 0]

    def say(look: tuple[Tensor, float]) -> Tensor:
        with torch.no_grad():
            return look[1] * torch.sigmoid(network(look[0][None])[0])

    # A thread for each: torch's own would change the last bits.
    found = np.zeros((len(OFFSETS) + 1, *size), np.float32)
    if values.numel():
        for said in in_threads(say, looks, cores()):
            found[:, *box] += said.numpy()
    return Affinities(found[:-1], found[-1], OFFSETS, (rgb.shape[0], rgb.shape[1]))


def save_affinity_network(network: AffinityNetwork, training: dict[str, Any], path: Path) -> None:
    """Write the file, whole or not at all. Errors: OutputError."""
    save_network(network, network.config, FORMAT, training, path)


def load_affinity_network(path: Path) -> AffinityNetwork:
    """The network of a file. Errors: WeightsError if it is missing, damaged or of another kind."""
    from brrp_cli.segmentation.affinity_network import AffinityNetwork, AffinityNetworkConfig

    def build(config: dict[str, Any]) -> AffinityNetwork:
        return AffinityNetwork(AffinityNetworkConfig(tuple(config["widths"])))

    return load_network(path, FORMAT, WHAT, build)


@cache
def shipped() -> AffinityNetwork:
    """The network that comes with the package."""
    with as_file(files("brrp_cli.segmentation") / NAME) as path:
        return load_affinity_network(path)
