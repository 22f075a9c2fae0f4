"""The occupancy version of PointSDF: a PointConv encoder and an MLP on code and query point.

Van der Merwe, Lu, Sundaralingam, Matak and Hermans, "Learning Continuous 3D Reconstructions for
Geometrically Aware Grasping", ICRA 2020; the encoder's layers are those of Wu, Qi and Li,
"PointConv", CVPR 2019. Plain PyTorch, on any device.

Clouds come in farthest-point order, of which every leading part is a farthest-point sample: the
centres of each layer are the first of those of the layer before. The published encoder has 512
centres in its first layer, which for clouds of 256 points are the 256 points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor, nn


@dataclass(frozen=True)
class NetworkConfig:
    """What the network is made of; lengths are in units of `scale`.

    Attributes
    ----------
    scale : metres; clouds and queries are divided by it
    points : of a cloud
    centres, bandwidths, features : of each encoder layer: points that are kept, the standard
        deviation of the density's kernel, and the widths of its point-wise layers
    neighbours : of a centre, the nearest of the layer before
    code, query_code : what a cloud and a query point are embedded in
    hidden : width of the MLP's layers
    dropout : of the query's embedding, in training
    """

    scale: float = 0.15
    points: int = 256
    centres: tuple[int, ...] = (512, 256, 64, 36)
    neighbours: int = 32
    bandwidths: tuple[float, ...] = (0.05, 0.1, 0.2, 0.4)
    features: tuple[tuple[int, ...], ...] = (
        (32, 32, 64),
        (64, 64, 64),
        (128, 128, 256),
        (256, 256, 512),
    )
    code: int = 256
    query_code: int = 256
    hidden: int = 512
    dropout: float = 0.2


def read_config(record: dict[str, Any]) -> NetworkConfig:
    """What `asdict` made of a NetworkConfig and JSON gave back. Errors: KeyError, TypeError."""
    return NetworkConfig(
        **{
            **record,
            "features": tuple(map(tuple, record["features"])),
            "centres": tuple(record["centres"]),
            "bandwidths": tuple(record["bandwidths"]),
        }
    )


class PointSDF(nn.Module):
    """Occupancy of points by a cloud: `decode(encode(cloud), queries)`, logits."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        self.encoder = Encoder(config)
        self.decoder = Decoder(config)

    def forward(self, clouds: Tensor, queries: Tensor) -> Tensor:
        """Logits (B, Q) at queries (B, Q, 3) for clouds (B, P, 3) in farthest-point order; both
        centred on the cloud's bounding box and divided by `config.scale`."""
        return self.decode(self.encode(clouds), queries)

    def encode(self, clouds: Tensor) -> Tensor:
        """Codes (B, C) of clouds (B, P, 3)."""
        codes: Tensor = self.encoder(clouds)
        return codes

    def decode(self, codes: Tensor, queries: Tensor) -> Tensor:
        """Logits (B, Q) at queries (B, Q, 3) for codes (B, C)."""
        logits: Tensor = self.decoder(codes, queries)
        return logits


class Encoder(nn.Module):
    """PointConv layers with fewer and fewer centres, then one linear layer on all that is left."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        layers = []
        width = 3
        for centres, bandwidth, features in zip(
            config.centres, config.bandwidths, config.features, strict=True
        ):
            kept = min(centres, config.points)
            layers.append(PointConv(kept, config.neighbours, bandwidth, width, features))
            width = features[-1]
        self.layers = nn.ModuleList(layers)
        self.code = linear(min(config.centres[-1], config.points) * width, config.code)

    def forward(self, clouds: Tensor) -> Tensor:
        """Codes (B, C)."""
        places, features = clouds, clouds
        for layer in self.layers:
            places, features = layer(places, features)
        code: Tensor = self.code(features.flatten(1))
        return code


class PointConv(nn.Module):
    """A convolution whose kernel is a function of where a neighbour lies.

    For each centre: sum over neighbours of (density weight) x (features) x (kernel), the last two
    an outer product, then a linear layer. The density weight makes up for places where points are
    many: it is a function of the inverse of the density, relative to the largest among neighbours.
    """

    KERNEL = 16

    def __init__(
        self,
        centres: int,
        neighbours: int,
        bandwidth: float,
        width: int,
        features: Sequence[int],
    ) -> None:
        super().__init__()
        self.centres = centres
        self.neighbours = neighbours
        self.bandwidth = bandwidth
        self.features = mlp(3 + width, features)
        self.kernel = mlp(3, (8, 8, self.KERNEL))
        self.density = nn.Sequential(*mlp(1, (16, 8)), nn.Linear(8, 1), nn.Sigmoid())
        self.combine = linear(self.KERNEL * features[-1], features[-1])

    def forward(self, places: Tensor, features: Tensor) -> tuple[Tensor, Tensor]:
        """Places (B, P, 3) and features (B, P, F) of points to those of centres, (B, S, ...)."""
        centres = places[:, : self.centres]
        batch, count = centres.shape[:2]
        with torch.no_grad():
            near = nearest(centres, places, self.neighbours)
            rare = take(1 / density(places, self.bandwidth)[..., None], near)
            rare = rare / rare.amax(dim=2, keepdim=True)
        offset = take(places, near) - centres[:, :, None]
        shape = (batch * count, near.shape[2])
        rows = shape[0] * shape[1]
        inputs = torch.cat([offset, take(features, near)], dim=-1).reshape(rows, -1)
        weight = self.density(rare.reshape(rows, 1))
        values = (self.features(inputs) * weight).reshape(*shape, -1)
        kernel = self.kernel(offset.reshape(rows, 3)).reshape(*shape, -1)
        joined = values.transpose(1, 2) @ kernel
        return centres, self.combine(joined.flatten(1)).reshape(batch, count, -1)


class Decoder(nn.Module):
    """Query points are embedded and joined with the code; the join comes in again half-way."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        hidden, both = config.hidden, config.code + config.query_code
        self.embed = nn.Sequential(
            nn.Linear(3, hidden),
            nn.ReLU(),
            nn.Dropout(config.dropout),
            nn.Linear(hidden, config.query_code),
            nn.ReLU(),
            nn.Dropout(config.dropout),
        )
        self.first = mlp(both, (hidden, hidden, hidden // 2))
        self.second = mlp(hidden // 2 + both, (hidden, hidden, hidden, hidden))
        self.out = nn.Linear(hidden, 1)

    def forward(self, codes: Tensor, queries: Tensor) -> Tensor:
        """Logits (B, Q) at queries (B, Q, 3) for codes (B, C)."""
        batch, count = queries.shape[:2]
        repeated = codes[:, None].expand(batch, count, codes.shape[1])
        joined = torch.cat([repeated, self.embed(queries)], dim=-1).flatten(0, 1)
        hidden = self.second(torch.cat([self.first(joined), joined], dim=-1))
        logits: Tensor = self.out(hidden).reshape(batch, count)
        return logits


def linear(inputs: int, outputs: int) -> nn.Sequential:
    """One layer on rows (n, inputs)."""
    return nn.Sequential(nn.Linear(inputs, outputs), nn.BatchNorm1d(outputs), nn.ReLU())


def mlp(inputs: int, widths: Sequence[int]) -> nn.Sequential:
    """Layers of `widths` on rows (n, inputs)."""
    return nn.Sequential(*(linear(a, b) for a, b in pairwise([inputs, *widths])))


def nearest(centres: Tensor, places: Tensor, count: int) -> Tensor:
    """Indices (B, S, K) of the `count` places (B, P, 3) nearest to each centre (B, S, 3)."""
    distance = torch.cdist(centres, places, compute_mode="donot_use_mm_for_euclid_dist")
    return distance.topk(min(count, places.shape[1]), dim=-1, largest=False, sorted=False).indices


def density(places: Tensor, bandwidth: float) -> Tensor:
    """Kernel density (B, P) of places (B, P, 3) at themselves, up to a factor."""
    distance = torch.cdist(places, places, compute_mode="donot_use_mm_for_euclid_dist")
    return torch.exp(-(distance**2) / (2 * bandwidth**2)).mean(dim=-1)


def take(values: Tensor, indices: Tensor) -> Tensor:
    """Rows (B, S, K, F) of values (B, P, F) at indices (B, S, K)."""
    batch = torch.arange(len(values), device=values.device)[:, None, None]
    return values[batch, indices]
