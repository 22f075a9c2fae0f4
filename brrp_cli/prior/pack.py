"""Between what the rest of the code handles (PriorObject) and what a shard holds (arrays)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.descriptors.descriptor import Appearance
from brrp_cli.descriptors.fpfh import FeatureCloud
from brrp_cli.geometry import normalise
from brrp_cli.prior.distance_field import DistanceField
from brrp_cli.prior.objects import PriorObject, RestingPose
from brrp_cli.prior.shape import StoredShape
from brrp_cli.prior.shard import APPEARANCE, ARRAYS, DISTANCES, MESH, StoredObject


def pack(item: PriorObject, input_sha256: str) -> StoredObject:
    """As it is stored: clouds joined, features and their normals in half precision."""
    clouds = list(item.clouds.values())
    arrays: dict[str, NDArray[Any]] = {
        "box": np.stack([item.center - _half(item), item.center + _half(item)]),
        "samples": item.samples,
        "labels": item.labels,
        "surface": item.surface,
        "surface_normals": item.surface_normals,
        "scales": np.array(list(item.clouds)),
        "cloud_starts": np.cumsum([0, *(len(cloud.points) for cloud in clouds)]),
        "cloud_points": np.concatenate([cloud.points for cloud in clouds]),
        "cloud_normals": np.concatenate([cloud.normals for cloud in clouds]),
        "cloud_fpfh": np.concatenate([cloud.fpfh for cloud in clouds]),
        "pose_T": np.stack([pose.T_plane_object for pose in item.poses]),
        "pose_probability": np.array([pose.probability for pose in item.poses]),
    }
    arrays |= {f"{APPEARANCE}/{key}": value for key, value in vars(item.appearance).items()}
    arrays |= {
        f"{MESH}/vertices": item.shape.vertices,
        f"{MESH}/faces": item.shape.faces,
        f"{MESH}/colours": item.shape.colours,
        f"{DISTANCES}/lower": item.shape.field.lower,
        f"{DISTANCES}/spacing": np.array([item.shape.field.spacing]),
        f"{DISTANCES}/values": item.shape.field.values,
    }
    typed = {key: arrays[key].astype(ARRAYS[key][0]) for key in ARRAYS}
    return StoredObject(item.name, input_sha256, typed, item.record)


def _half(item: PriorObject) -> np.ndarray:
    return np.asarray(item.record["extents"]) / 2


def unpack(stored: StoredObject, description: str) -> PriorObject:
    """As it is used: float64 clouds by scale, unit normals, labels as bool."""
    arrays = stored.arrays
    lower, upper = arrays["box"]
    return PriorObject(
        name=stored.name,
        description=description,
        center=(lower + upper) / 2,
        half_extent=float((upper - lower).max() / 2),
        samples=arrays["samples"],
        labels=arrays["labels"].astype(bool),
        surface=arrays["surface"],
        surface_normals=arrays["surface_normals"],
        clouds=_Clouds(arrays),
        poses=[
            RestingPose(T, float(p))
            for T, p in zip(arrays["pose_T"], arrays["pose_probability"], strict=True)
        ],
        record=stored.record,
        appearance=Appearance(
            **{f.name: arrays[f"{APPEARANCE}/{f.name}"] for f in fields(Appearance)}
        ),
        shape=_unpack_shape(arrays),
    )


class _Clouds(Mapping[float, FeatureCloud]):
    """Clouds by scale, each made as it is asked for: of an object's ten, searches take one, and in
    double precision they are four times as large as stored."""

    def __init__(self, arrays: dict[str, NDArray[Any]]) -> None:
        self._stored = [arrays[f"cloud_{key}"] for key in ("points", "normals", "fpfh")]
        starts = arrays["cloud_starts"].tolist()
        self._rows = {
            float(scale): slice(a, b)
            for scale, a, b in zip(arrays["scales"], starts[:-1], starts[1:], strict=True)
        }

    def __getitem__(self, scale: float) -> FeatureCloud:
        rows = self._rows[scale]
        points, normals, fpfh = (each[rows].astype(np.float64) for each in self._stored)
        return FeatureCloud(points, normalise(normals), fpfh)

    def __iter__(self) -> Iterator[float]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)


def _unpack_shape(arrays: dict[str, NDArray[Any]]) -> StoredShape:
    field = DistanceField(
        lower=arrays[f"{DISTANCES}/lower"],
        spacing=float(arrays[f"{DISTANCES}/spacing"][0]),
        values=arrays[f"{DISTANCES}/values"].astype(np.float32),
    )
    return StoredShape(
        vertices=arrays[f"{MESH}/vertices"],
        faces=arrays[f"{MESH}/faces"],
        colours=arrays[f"{MESH}/colours"],
        field=field,
    )
