"""Affinities of pixels, by the network that comes with the package.

`tools/train_masks.py` trains it and says on what; brrp_cli/segmentation/affinities.safetensors
holds it (network_files.py).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import AffinitiesConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.last_frame import kept_for_last_image
from brrp_cli.network_files import load_network, save_network
from brrp_cli.segmentation.image_channels import COLOURS, image_channels, step_of
from brrp_cli.segmentation.seen_surfaces import SeenSurfaces
from brrp_cli.threads import cores, in_threads

if TYPE_CHECKING:
    from torch import Tensor

    from brrp_cli.segmentation.affinity_network import AffinityNetwork

FORMAT = "brrp affinities 1"
NAME = "affinities.safetensors"


@dataclass(frozen=True)
class Affinities:
    """What the network says of an image (H, W) of which `step` pixels along each axis became one.

    same : (K, h, w) probability that a pixel and the one `offsets` (K, 2) from it show one object;
    object : (h, w) that it shows one
    shape : (H, W), of which the last rows and columns may be missing in (h, w)
    """

    same: NDArray[np.float32]
    object: NDArray[np.float32]
    offsets: tuple[tuple[int, int], ...]
    shape: tuple[int, int]
    step: int

    def sample(self, values: NDArray) -> NDArray:
        """(h, w) of (H, W): one pixel of those that became one."""
        middle = self.step // 2
        return values[self._window][middle :: self.step, middle :: self.step]

    def enlarge(self, values: NDArray) -> NDArray:
        """(H, W) of (h, w), 0 where the network saw nothing."""
        found = np.zeros(self.shape, values.dtype)
        found[self._window] = values.repeat(self.step, axis=0).repeat(self.step, axis=1)
        return found

    @property
    def _window(self) -> tuple[slice, slice]:
        rows, columns = self.object.shape
        return np.s_[: rows * self.step, : columns * self.step]


@kept_for_last_image
def affinities_in(frame: Frame, seen: SeenSurfaces, config: AffinitiesConfig) -> Affinities:
    """What the network that comes with the package says of a frame and the surfaces seen in it."""
    return affinities_of(frame.rgb, seen, shipped(), config.colour)


def affinities_of(
    rgb: NDArray[np.uint8], seen: SeenSurfaces, network: AffinityNetwork, colour: float = 1.0
) -> Affinities:
    """What the network says of colours (H, W, 3) and the surfaces that were seen.

    colour : what it says so counts so much, and the rest what it says where all colours are one
    """
    import torch

    from brrp_cli.segmentation.affinity_network import OFFSETS

    values = torch.from_numpy(image_channels(rgb, seen)).float() / 63
    blind = values.clone()
    blind[COLOURS] = 0
    looks = [(look, w) for look, w in ((values, colour), (blind, 1 - colour)) if w > 0]

    def say(look: tuple[Tensor, float]) -> Tensor:
        with torch.no_grad():
            return look[1] * torch.sigmoid(network(look[0][None])[0])

    # A thread for each: torch's own would change the last bits.
    found = torch.stack(list(in_threads(say, looks, cores()))).sum(dim=0).numpy()
    shape = rgb.shape[0], rgb.shape[1]
    return Affinities(found[:-1], found[-1], OFFSETS, shape, step_of(shape))


def save_affinity_network(network: AffinityNetwork, training: dict[str, Any], path: Path) -> None:
    """Write the file, whole or not at all. Errors: OutputError."""
    save_network(network, network.config, FORMAT, training, path)


def load_affinity_network(path: Path) -> AffinityNetwork:
    """The network of a file. Errors: WeightsError if it is missing, damaged or of another kind."""
    from brrp_cli.segmentation.affinity_network import AffinityNetwork, AffinityNetworkConfig

    def build(config: dict[str, Any]) -> AffinityNetwork:
        return AffinityNetwork(AffinityNetworkConfig(tuple(config["widths"])))

    return load_network(path, FORMAT, "the network that parts objects", build)


@cache
def shipped() -> AffinityNetwork:
    """The network that comes with the package."""
    with as_file(files("brrp_cli.segmentation") / NAME) as path:
        return load_affinity_network(path)
