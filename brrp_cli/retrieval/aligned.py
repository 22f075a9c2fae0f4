"""Stored objects laid over what is seen: the alignment score of each, for retrieval."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SearchConfig, VerificationConfig
from brrp_cli.config.registration import SilhouetteConfig
from brrp_cli.config.retrieval import AlignmentConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import similarity
from brrp_cli.observation.support_plane import Plane
from brrp_cli.prior.distance_field import DistanceField
from brrp_cli.prior.shard import DISTANCES
from brrp_cli.prior.store import Prior
from brrp_cli.registration.model import BareModel
from brrp_cli.registration.quick_alignment import (
    Aligned,
    aligned,
    finely,
    first_placements,
)
from brrp_cli.registration.silhouette import Silhouette, bare_and_spilled, silhouette
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
# What speaks against placements (b,), from the shares of the mask that they leave bare, and cover
# beside it.
Shares = NDArray[np.floating]
Against = Callable[[Shares, Shares], Shares]
# Models that are held in memory, 0.2 MB each.
HELD = 1024


class Aligner:
    """Places stored objects, and keeps the models that it read last."""

    def __init__(self, prior: Prior, config: AlignmentConfig) -> None:
        self._prior = prior
        self._config = config
        self._held: OrderedDict[str, BareModel] = OrderedDict()

    def on(
        self,
        points: NDArray[np.floating],
        frame: Frame,
        object_id: int,
        plane: Plane,
        wave: float,
    ) -> SeenPart:
        """What objects are laid over: points (n, 3) of an object, metres, camera frame, in random
        order.

        wave : metres, by which the frame's depth errs over patches (observation/sensor_noise.py)
        """
        search = replace(
            self._config.search,
            alignment_score=tolerant(
                self._config.search.alignment_score, self._config.waves * wave
            ),
        )
        seen = silhouette(frame, object_id, self._config.silhouette)
        verifier = Verifier(points.astype(np.float64), frame, plane)
        return SeenPart(self, verifier, seen, search, self._config.silhouette)

    def models(self, names: Sequence[str]) -> list[BareModel]:
        """The models of objects of these names. Errors: PriorError."""
        new = [name for name in names if name not in self._held]
        for name, arrays in self._prior.parts(new, PARTS):
            self._held[name] = bare_model(arrays, self._config.search.fine_points)
        for name in names:
            self._held.move_to_end(name)
        models = [self._held[name] for name in names]
        while len(self._held) > HELD:
            self._held.popitem(last=False)
        return models


def tolerant(score: VerificationConfig, deviation: float) -> VerificationConfig:
    """The numbers of a score where depth is off by `deviation`, metres: the true object is no
    further away and no less far in front than that. Sensors that err by less change nothing."""
    near = max(score.near, deviation)
    return replace(
        score,
        near=near,
        far=score.far * near / score.near,
        tolerance=max(score.tolerance, deviation),
    )


class SeenPart:
    """What is seen of one object, and how stored ones lie over it."""

    def __init__(
        self,
        aligner: Aligner,
        verifier: Verifier,
        seen: Silhouette,
        search: SearchConfig,
        config: SilhouetteConfig,
    ) -> None:
        self._aligner = aligner
        self._verifier = verifier
        self._silhouette = seen
        self._search = search
        self._config = config
        self._first: dict[str, Aligned] = {}
        self._placed: dict[str, Aligned] = {}

    def first_scores(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Alignment scores (m,) of the objects of these names after the first few steps. Errors:
        PriorError."""
        for name, model in zip(names, self._aligner.models(names), strict=True):
            self._first[name] = first_placements(model, self._verifier, self._search)
        return np.array([self._first[name].score for name in names])

    def scores(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Alignment scores (m,) of objects that `first_scores` was asked for."""
        models = self._aligner.models(names)
        first = [self._first[name] for name in names]
        placed = aligned(models, first, self._verifier, self._search)
        self._placed.update(zip(names, placed, strict=True))
        return np.array([each.score for each in placed])

    def last_scores(
        self, names: Sequence[str], last: SearchConfig, against: Against
    ) -> NDArray[np.float64]:
        """Those (m,) of objects that `scores` was asked for, refined once more by `fine`,
        `fine_points`, `fine_distance` and `fine_steps` of `last`.

        against : what silhouettes say against placements, in alignment scores. Those placements of
        an object are refined, and the one of them is kept, whose score less that is best.
        """
        search = replace(last, alignment_score=self._search.alignment_score)
        for name, model in zip(names, self._aligner.models(names), strict=True):
            placed = self._placed[name].first(self._search.fine)
            placed = finely(self._agreeing(placed, model, against), model, self._verifier, search)
            self._placed[name] = self._agreeing(placed, model, against)
        return np.array([self._placed[name].score for name in names])

    def silhouettes(self, names: Sequence[str]) -> NDArray[np.float64]:
        """(2, m) of the placements of objects that `scores` was asked for: shares of the mask that
        they leave bare, and cover beside it (registration/silhouette.py)."""
        models = self._aligner.models(names)
        found = [
            self._shares(self._placed[name].first(1), model)
            for name, model in zip(names, models, strict=True)
        ]
        return np.concatenate([np.zeros((2, 0)), *found], axis=1)

    def _agreeing(self, placed: Aligned, model: BareModel, against: Against) -> Aligned:
        """The placements whose scores and silhouettes are best first."""
        return placed.ordered(placed.scores - against(*self._shares(placed, model)))

    def _shares(self, placed: Aligned, model: BareModel) -> NDArray[np.float64]:
        """Bare and spilled (2, b) of each placement."""
        tolerance = self._search.alignment_score.tolerance
        return np.array(
            [
                bare_and_spilled(T, model, self._silhouette, tolerance, self._config)
                for T in placed.T_cam_model
            ]
        ).T


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
