"""Stored objects laid over what is seen: the alignment score of each, for retrieval."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SearchConfig
from brrp_cli.config.retrieval import AlignmentConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.observation.support_plane import Plane
from brrp_cli.registration.begin import coarse_score
from brrp_cli.registration.glance import glance
from brrp_cli.registration.mask_poses import MaskOutline, mask_outline, poses_from_mask
from brrp_cli.registration.model import BareModel
from brrp_cli.registration.quick_alignment import (
    Aligned,
    aligned,
    finely,
    first_placements,
)
from brrp_cli.registration.silhouette import Silhouette, bare_and_spilled, silhouette
from brrp_cli.registration.verification import Verifier, in_waves
from brrp_cli.retrieval.held_models import HeldModels

# What speaks against placements (b,), from the shares of the mask that they leave bare, and cover
# beside it.
Shares = NDArray[np.floating]
Against = Callable[[Shares, Shares], Shares]


def seen_part(
    points: NDArray[np.floating],
    frame: Frame,
    object_id: int,
    plane: Plane,
    wave: float,
    models: HeldModels,
    config: AlignmentConfig,
    against: Against,
) -> SeenPart:
    """What objects are laid over: points (n, 3) of an object, metres, camera frame, in random
    order.

    wave : metres, by which the frame's depth errs over patches (observation/sensor_noise.py)
    against : what silhouettes say against placements, in alignment scores
    """
    search = in_waves(config.search, wave)
    verifier = Verifier(points.astype(np.float64), frame, plane)
    blind = len(points) < config.blind * (frame.segmap == object_id).sum()
    mask = Mask(
        silhouette(frame, object_id, config.silhouette),
        mask_outline(frame, object_id, plane, config.by_mask),
        blind,
    )
    return SeenPart(models, verifier, mask, search, config, against)


@dataclass(frozen=True)
class Mask:
    """What a mask says of where objects lie. blind : depth shows too little of it to tell alone"""

    silhouette: Silhouette
    outline: MaskOutline
    blind: bool


class SeenPart:
    """What is seen of one object, and how stored ones lie over it."""

    def __init__(
        self,
        models: HeldModels,
        verifier: Verifier,
        mask: Mask,
        search: SearchConfig,
        config: AlignmentConfig,
        against: Against,
    ) -> None:
        self._models = models
        self._against = against
        self._verifier = verifier
        self._mask = mask
        self._search = search
        self._config = config
        self._first: dict[str, Aligned] = {}
        self._placed: dict[str, Aligned] = {}

    @property
    def blind(self) -> bool:
        """Of the mask: see `Mask`."""
        return self._mask.blind

    def glances(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Scores (m,) of the objects of these names at a glance. Errors: PriorError."""
        models = self._models.coarse(names)
        search = replace(self._config.glance, alignment_score=self._search.alignment_score)
        return np.array([glance(model, self._verifier, search) for model in models])

    def first_scores(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Alignment scores (m,) of the objects of these names after the first few steps; of what
        depth shows a part of, less what their silhouettes say against them. Errors: PriorError."""
        found = []
        for name, model in zip(names, self._models.of(names), strict=True):
            first, against = self._begun(model)
            self._first[name] = first
            found.append(first.score - against)
        return np.array(found)

    def scores(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Alignment scores (m,) of objects that `first_scores` was asked for."""
        models = self._models.of(names)
        first = [self._first[name] for name in names]
        ordered = self._best_agreeing if self._mask.blind else None
        placed = aligned(models, first, self._verifier, self._search, ordered)
        self._placed.update(zip(names, placed, strict=True))
        return np.array([each.score for each in placed])

    def last_scores(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Those (m,) of objects that `scores` was asked for, refined once more by `finest`. Of the
        placements of an object those are refined, and the one of them is kept, whose score less
        what silhouettes say against it is best."""
        search = replace(self._config.finest, alignment_score=self._search.alignment_score)
        for name, model in zip(names, self._models.of(names), strict=True):
            placed = self._placed[name].first(self._search.fine)
            placed = finely(self._agreeing(placed, model), model, self._verifier, search)
            self._placed[name] = self._agreeing(placed, model)
        return np.array([self._placed[name].score for name in names])

    def silhouettes(self, names: Sequence[str]) -> NDArray[np.float64]:
        """(2, m) of the placements of objects that `scores` was asked for: shares of the mask that
        they leave bare, and cover beside it (registration/silhouette.py)."""
        models = self._models.of(names)
        found = [
            self._shares(self._placed[name].T_cam_model[:1], model)
            for name, model in zip(names, models, strict=True)
        ]
        return np.concatenate([np.zeros((2, 0)), *found], axis=1)

    def silhouettes_by_mask(self, names: Sequence[str]) -> NDArray[np.float64]:
        """The same (2, m) of the placements that the mask alone suggests; all of it, of an object
        that rests in no pose. Errors: PriorError."""
        found = np.ones((2, len(names)))
        for row, model in enumerate(self._models.of(names)):
            shares = self._shares(self._by_mask(model), model)
            if shares.shape[1]:
                found[:, row] = shares[:, self._against(*shares).argmin()]
        return found

    def _begun(self, model: BareModel) -> tuple[Aligned, float]:
        """The first placements of a model; where depth shows too little, those by the mask among
        them, and what the silhouette says against the best."""
        first = first_placements(model, self._verifier, self._search)
        if not self._mask.blind:
            return first, 0.0
        T = self._by_mask(model)
        scores = coarse_score(T, model, self._verifier, self._search)
        best, rest = first.first(self._search.fine), first.after(self._search.fine)
        both = self._agreeing(best.followed_by(Aligned(T, scores)), model)
        against = self._against(*self._shares(both.T_cam_model[:1], model))
        return both.followed_by(rest), float(against[0])

    def _by_mask(self, model: BareModel) -> NDArray[np.float64]:
        return poses_from_mask(model, self._mask.outline, self._config.by_mask)

    def _best_agreeing(self, placed: Aligned, model: BareModel) -> Aligned:
        """The same of those with the best scores, twice as many as are refined further."""
        most = 2 * self._search.fine
        return self._agreeing(placed.first(most), model).followed_by(placed.after(most))

    def _agreeing(self, placed: Aligned, model: BareModel) -> Aligned:
        """The placements whose scores and silhouettes are best first."""
        against = self._against(*self._shares(placed.T_cam_model, model))
        return placed.ordered(placed.scores - against)

    def _shares(self, T_cam_model: NDArray[np.float64], model: BareModel) -> NDArray[np.float64]:
        """Bare and spilled (2, b) of each placement (b, 4, 4)."""
        tolerance = self._search.alignment_score.tolerance
        seen, config = self._mask.silhouette, self._config.silhouette
        return np.stack(bare_and_spilled(T_cam_model, model, seen, tolerance, config))
