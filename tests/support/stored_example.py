"""An object of a prior with every array that a shard holds, of random numbers."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from brrp_cli.descriptors.colour_histogram import COLOUR_BINS
from brrp_cli.descriptors.descriptor import Appearance
from brrp_cli.descriptors.fpfh import FeatureCloud
from brrp_cli.descriptors.point_pairs import PAIR_BINS
from brrp_cli.prior.distance_field import DistanceField
from brrp_cli.prior.objects import PriorObject, RestingPose
from brrp_cli.prior.shape import StoredShape


def example(name: str = "cup", seed: int = 0) -> PriorObject:
    rng = np.random.default_rng(seed)

    def cloud(n: int) -> FeatureCloud:
        normals = rng.normal(size=(n, 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return FeatureCloud(rng.normal(size=(n, 3)), normals, rng.uniform(0, 200, (n, 33)))

    return PriorObject(
        name=name,
        description="a cup",
        center=np.array([0.25, -0.5, 1.0]),
        half_extent=0.0625,
        samples=rng.normal(size=(50, 3)).astype(np.float32),
        labels=rng.random(50) < 0.5,
        surface=rng.normal(size=(20, 3)).astype(np.float32),
        surface_normals=rng.normal(size=(20, 3)).astype(np.float32),
        clouds={0.5: cloud(7), 1.22: cloud(13)},
        poses=[RestingPose(np.eye(4), 0.75), RestingPose(np.diag([1.0, -1, -1, 1]), 0.25)],
        record={"extents": [0.125, 0.0625, 0.03125], "repair": {"steps": []}},
        appearance=Appearance(
            colour=rng.integers(0, 256, (5, COLOUR_BINS), dtype=np.uint8),
            pairs=rng.integers(0, 256, (5, PAIR_BINS), dtype=np.uint8),
            sizes=rng.random((2, 3), dtype=np.float32),
        ),
        shape=StoredShape(
            vertices=rng.normal(size=(30, 3)).astype(np.float32),
            faces=rng.integers(0, 30, (40, 3), dtype=np.int32),
            colours=rng.integers(0, 256, (30, 3), dtype=np.uint8),
            field=DistanceField(
                lower=np.array([-1.5, -1.25, -0.75]),
                spacing=0.5,
                # As a shard keeps them, in half precision.
                values=rng.normal(size=(7, 6, 4)).astype(np.float16).astype(np.float32),
            ),
        ),
    )


def with_field(item: PriorObject, field: DistanceField, **changes: Any) -> PriorObject:
    """The same with another field of distances."""
    return replace(item, shape=replace(item.shape, field=field), **changes)
