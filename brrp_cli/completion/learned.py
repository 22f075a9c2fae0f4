"""The completion that has learned shapes, as it comes with the package.

`tools/train_completion.py` trains it and says on what; brrp_cli/completion/shapes.safetensors holds
it (network_files.py).
"""

from __future__ import annotations

from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.completion.point_features import point_features
from brrp_cli.completion.visible_part import VisiblePart
from brrp_cli.completion.volume import volume_of
from brrp_cli.config import VolumeConfig
from brrp_cli.network_files import load_network, save_network

if TYPE_CHECKING:
    from torch import Tensor

    from brrp_cli.completion.shape_network import ShapeNetwork

Floats = NDArray[np.float32]

# So many points at once: what is known of them stays in the cache.
CHUNK = 8_192

FORMAT = "brrp completion 1"
NAME = "shapes.safetensors"


class LearnedShape:
    """What the network thinks of one object: its volume is looked at once, and then it is asked at
    points."""

    def __init__(self, part: VisiblePart, config: VolumeConfig, network: ShapeNetwork) -> None:
        import torch

        self.part, self.network = part, network
        self.volume = volume_of(part, config)
        with torch.no_grad():
            values = torch.from_numpy(self.volume.values.astype(np.float32) / 127)
            self.features: Tensor = network.encode(values[None])

    def logits(self, points: NDArray[np.floating]) -> Floats:
        """Log odds (n,) that points (n, 3), metres, camera frame, are inside."""

        if not len(points):
            return np.empty(0, np.float32)
        found = [self._thought(points[a : a + CHUNK]) for a in range(0, len(points), CHUNK)]
        return np.asarray(np.concatenate(found) + np.float32(self.part.config.bias))

    def _thought(self, points: NDArray[np.floating]) -> Floats:
        import torch

        network = self.network
        places = torch.from_numpy(self.volume.places(points))
        lengths = torch.from_numpy(point_features(np.asarray(points, np.float64), self.part))
        with torch.no_grad():
            found = network.at(self.features, places[None])[0]
            thought: Floats = network.decide(network.scaled(lengths), found).numpy()
        return thought


def save_shapes(network: ShapeNetwork, training: dict[str, Any], path: Path) -> None:
    """Write the file, whole or not at all. Errors: OutputError."""
    save_network(network, network.config, FORMAT, training, path)


def load_shapes(path: Path) -> ShapeNetwork:
    """The network of a file. Errors: WeightsError if it is missing, damaged or of another kind."""
    from brrp_cli.completion.shape_network import ShapeNetwork, ShapeNetworkConfig

    def build(config: dict[str, Any]) -> ShapeNetwork:
        return ShapeNetwork(ShapeNetworkConfig(**{**config, "widths": tuple(config["widths"])}))

    return load_network(path, FORMAT, "the completion", build)


@cache
def shapes() -> ShapeNetwork:
    """The network that comes with the package."""
    with as_file(files("brrp_cli.completion") / NAME) as path:
        return load_shapes(path)
