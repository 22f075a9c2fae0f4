"""Stored objects laid over what is seen: the alignment score of each, for retrieval."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.retrieval import AlignmentConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import similarity
from brrp_cli.observation.support_plane import Plane
from brrp_cli.prior.distance_field import DistanceField
from brrp_cli.prior.shard import DISTANCES
from brrp_cli.prior.store import Prior
from brrp_cli.registration.model import BareModel
from brrp_cli.registration.quick_alignment import alignment_scores
from brrp_cli.registration.verification import Verifier

# What is read of each object.
PARTS = (
    "box",
    "surface",
    "surface_normals",
    "pose_T",
    f"{DISTANCES}/lower",
    f"{DISTANCES}/spacing",
    f"{DISTANCES}/values",
)
# Models that are held in memory, 0.2 MB each.
HELD = 256


class Aligner:
    """Places stored objects, and keeps the models that it read last."""

    def __init__(self, prior: Prior, config: AlignmentConfig) -> None:
        self._prior = prior
        self._config = config
        self._held: OrderedDict[str, BareModel] = OrderedDict()

    def scores(
        self, points: NDArray[np.floating], frame: Frame, plane: Plane, names: Sequence[str]
    ) -> NDArray[np.float64]:
        """Alignment scores (m,) of the objects of these names on points (n, 3), metres, camera
        frame, in random order. Errors: PriorError."""
        verifier = Verifier(points.astype(np.float64), frame, plane)
        return alignment_scores(self._models(names), verifier, self._config.search)

    def _models(self, names: Sequence[str]) -> list[BareModel]:
        new = [name for name in names if name not in self._held]
        for name, arrays in self._prior.parts(new, PARTS):
            self._held[name] = bare_model(arrays, self._config.search.fine_points)
        for name in names:
            self._held.move_to_end(name)
        models = [self._held[name] for name in names]
        while len(self._held) > HELD:
            self._held.popitem(last=False)
        return models


def bare_model(arrays: dict[str, NDArray[Any]], points: int) -> BareModel:
    """The model of an object's arrays (`PARTS`), with so many points of its surface."""
    lower, upper = arrays["box"]
    half = float((upper - lower).max() / 2)
    T_object_model = similarity(translation=(lower + upper) / 2)
    return BareModel(
        field=DistanceField(
            lower=arrays[f"{DISTANCES}/lower"],
            spacing=float(arrays[f"{DISTANCES}/spacing"][0]),
            values=arrays[f"{DISTANCES}/values"].astype(np.float32),
        ),
        half_extent=half,
        surface=arrays["surface"][:points].astype(np.float64) * half,
        normals=arrays["surface_normals"][:points].astype(np.float64),
        resting=[T @ T_object_model for T in arrays["pose_T"]],
    )
