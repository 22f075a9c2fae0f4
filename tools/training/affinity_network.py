"""A network that says of two pixels near each other whether they show one object: a small U-Net.

It gives an affinity for each pixel and the one that lies `OFFSETS` from it
(brrp_cli/segmentation/pixel_pairs.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn.functional import avg_pool2d, interpolate, pad

from brrp_cli.segmentation.image_channels import CHANNELS
from brrp_cli.segmentation.pixel_pairs import OFFSETS

# A pixel of the coarsest level, in those of the image, which is padded to a multiple of it.
_MULTIPLE = 32


@dataclass(frozen=True)
class AffinityNetworkConfig:
    """widths : channels at full size, and at a half, a quarter, ... a 32nd of it"""

    widths: tuple[int, int, int, int, int, int] = (12, 16, 32, 48, 72, 96)


class AffinityNetwork(nn.Module):
    """Logits (B, len(OFFSETS) + 1, h, w) from channels (B, CHANNELS, h, w): affinities, and at last
    that the pixel shows an object.

    Most of it works at half size and below, which sees the image itself, made smaller, besides what
    the full size says of it.
    """

    def __init__(self, config: AffinityNetworkConfig) -> None:
        super().__init__()
        self.config = config
        full, *widths = config.widths
        half, *others = widths
        self.first = nn.Sequential(nn.Conv2d(CHANNELS, full, 3, padding=1), Block(full))
        self.first_down = nn.Conv2d(full, half, 2, stride=2, bias=False)
        self.fine = nn.Sequential(nn.Conv2d(CHANNELS, half, 3, padding=1), Block(half))
        self.down = nn.ModuleList(
            nn.Sequential(nn.Conv2d(wide, narrow, 2, stride=2), Block(narrow), Block(narrow))
            for wide, narrow in zip(widths, others, strict=False)
        )
        self.join = nn.ModuleList(
            Join(narrow, wide) for wide, narrow in zip(widths, others, strict=False)
        )
        self.up = nn.ModuleList(Block(wide) for wide in widths[:-1])
        self.last_join = Join(half, full)
        self.last_up = Block(full)
        self.out = nn.Conv2d(full, len(OFFSETS) + 1, 3, padding=1)

    def forward(self, values: Tensor) -> Tensor:
        """The logits of images."""
        height, width = values.shape[2:]
        values = pad(values, (0, -width % _MULTIPLE, 0, -height % _MULTIPLE))
        full = self.first(values)
        begin, block = self.fine
        levels = [block(begin(avg_pool2d(values, 2)) + self.first_down(full))]
        for down in self.down:
            levels.append(down(levels[-1]))
        found = levels.pop()
        for join, up in zip(reversed(self.join), reversed(self.up), strict=True):
            found = up(join(found, levels.pop()))
        logits: Tensor = self.out(self.last_up(self.last_join(found, full)))
        return logits[..., :height, :width]


class Block(nn.Module):
    """x + relu(norm(convolution(x)))."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.convolution = nn.Conv2d(channels, channels, 3, padding=1)
        self.norm = nn.GroupNorm(4, channels)

    def forward(self, x: Tensor) -> Tensor:
        """As many channels as before."""
        return x + torch.relu(self.norm(self.convolution(x)))


class Join(nn.Module):
    """The coarse level brought to the resolution of the fine one, and added to it."""

    def __init__(self, coarse: int, fine: int) -> None:
        super().__init__()
        self.coarse = nn.Conv2d(coarse, fine, 1)
        self.fine = nn.Conv2d(fine, fine, 1, bias=False)

    def forward(self, coarse: Tensor, fine: Tensor) -> Tensor:
        """(B, fine, h, w) from (B, coarse, h / 2, w / 2) and (B, fine, h, w)."""
        up = interpolate(self.coarse(coarse), scale_factor=2, mode="nearest")
        return self.fine(fine) + up
