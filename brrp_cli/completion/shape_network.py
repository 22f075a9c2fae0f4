"""A network that has learned shapes: a small 3D U-Net, and what it says of a point.

The U-Net (Cicek et al., "3D U-Net", MICCAI 2016) turns a volume (volume.py) into features, one
vector for each two voxels along each axis. At a point they are interpolated and, together with
the lengths of point_features.py at exactly that point, decide whether it is inside: the volume
knows the shape, the lengths know on which side of a thin wall the point lies (compare Peng et al.,
"Convolutional Occupancy Networks", ECCV 2020).
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn.functional import conv2d, grid_sample, interpolate, pad

from brrp_cli.completion.volume import CHANNELS


@dataclass(frozen=True)
class ShapeNetworkConfig:
    """lengths : of a point; features : of the volume at a point; widths : channels of the U-Net at
    a half, a quarter and an eighth of the volume's resolution; hidden : of the last layers"""

    lengths: int = 72
    features: int = 24
    widths: tuple[int, int, int] = (24, 48, 96)
    hidden: int = 128
    dropout: float = 0.1


class ShapeNetwork(nn.Module):
    """Logits of occupancy. `middle` and `spread` (lengths,) scale the lengths; `temperature`
    divides the logits."""

    middle: Tensor
    spread: Tensor
    temperature: Tensor

    def __init__(self, config: ShapeNetworkConfig) -> None:
        super().__init__()
        self.config = config
        self.volume = UNet(config.widths, config.features)
        inputs = config.lengths + config.features
        self.point = nn.Sequential(
            nn.Linear(inputs, config.hidden),
            nn.ReLU(),
            nn.Dropout(config.dropout),
            nn.Linear(config.hidden, config.hidden),
            nn.ReLU(),
            nn.Dropout(config.dropout),
            nn.Linear(config.hidden, 1),
        )
        # The volume alone: only while it is trained.
        self.coarse = nn.Linear(config.features, 1)
        self.register_buffer("middle", torch.zeros(config.lengths))
        self.register_buffer("spread", torch.ones(config.lengths))
        self.register_buffer("temperature", torch.ones(()))

    def encode(self, values: Tensor) -> Tensor:
        """Features (B, F, n / 2, n / 2, n / 2) of volumes (B, CHANNELS, n, n, n)."""
        features: Tensor = self.volume(values)
        return features

    def at(self, features: Tensor, places: Tensor) -> Tensor:
        """Features (B, Q, F) at places (B, Q, 3), -1 to 1 along the volume's axes; trilinear."""
        # grid_sample wants the last axis first.
        asked = places.flip(-1)[:, :, None, None]
        found = grid_sample(features, asked, padding_mode="border", align_corners=False)
        return found[:, :, :, 0, 0].transpose(1, 2)

    def scaled(self, lengths: Tensor) -> Tensor:
        """Lengths (..., 72) as the layers read them."""
        return (lengths - self.middle) / self.spread

    def decide(self, scaled: Tensor, found: Tensor) -> Tensor:
        """Logits (...) from scaled lengths (..., 72) and features (..., F)."""
        # Feature by feature, as both come: to turn them over takes as long as a layer.
        inputs = torch.cat([scaled.mT, found.mT], dim=-2).mT
        logits: Tensor = self.point(inputs)[..., 0]
        return logits / self.temperature


class UNet(nn.Module):
    """From (B, CHANNELS, n, n, n), n a multiple of 8, to (B, features, n / 2, n / 2, n / 2)."""

    def __init__(self, widths: tuple[int, int, int], features: int) -> None:
        super().__init__()
        first, second, third = widths
        # Two voxels along each axis become one with eight times the channels: nothing is lost.
        self.stem = nn.Conv3d(CHANNELS, first, 2, stride=2)
        self.fine = Block(first, first)
        self.down1 = nn.Conv3d(first, second, 2, stride=2)
        self.middle = nn.Sequential(Block(second, second), Block(second, second))
        self.down2 = nn.Conv3d(second, third, 2, stride=2)
        self.coarse = nn.Sequential(Block(third, third), Block(third, third))
        self.join2 = Join(third, second)
        self.up2 = Block(second, second)
        self.join1 = Join(second, first)
        self.up1 = Block(first, first)
        self.out = nn.Conv3d(first, features, 1)

    def forward(self, values: Tensor) -> Tensor:
        """The features of volumes."""
        fine = self.fine(self.stem(values))
        middle = self.middle(self.down1(fine))
        coarse = self.coarse(self.down2(middle))
        middle = self.up2(self.join2(coarse, middle))
        fine = self.up1(self.join1(middle, fine))
        found: Tensor = self.out(fine)
        return found


class Block(nn.Module):
    """x + relu(norm(convolution(x)))."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.convolution = nn.Conv3d(inputs, outputs, 3, padding=1)
        self.norm = nn.GroupNorm(4, outputs)

    def forward(self, x: Tensor) -> Tensor:
        """As many channels as before."""
        return x + torch.relu(self.norm(convolved(x, self.convolution)))


def convolved(x: Tensor, convolution: nn.Conv3d) -> Tensor:
    """convolution(x), 3 x 3 x 3 with a padding of 1, of x (B, C, n, n, n).

    torch has no fast kernel for a single volume on a processor: its layers are convolved as a batch
    of images, each with the one before and the one after it as more channels.
    """
    if len(x) != 1 or x.is_cuda:
        found: Tensor = convolution(x)
        return found
    layers = pad(x[0], (0, 0, 0, 0, 1, 1)).transpose(0, 1)
    count = x.shape[2]
    images = torch.cat([layers[step : step + count] for step in range(3)], dim=1)
    kernels = convolution.weight.transpose(1, 2).flatten(1, 2)
    return conv2d(images, kernels, convolution.bias, padding=1).transpose(0, 1)[None]


class Join(nn.Module):
    """What one layer of 1 x 1 x 1 makes of the coarse level, brought to the resolution of the fine
    one, and of that together; each is multiplied where it is smaller."""

    def __init__(self, coarse: int, fine: int) -> None:
        super().__init__()
        self.coarse = nn.Conv3d(coarse, fine, 1)
        self.fine = nn.Conv3d(fine, fine, 1, bias=False)

    def forward(self, coarse: Tensor, fine: Tensor) -> Tensor:
        """(B, fine, n, n, n) from (B, coarse, n / 2, n / 2, n / 2) and (B, fine, n, n, n)."""
        up = interpolate(self.coarse(coarse), scale_factor=2, mode="nearest")
        return self.fine(fine) + up
