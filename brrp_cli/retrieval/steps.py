"""What retrieval by appearance does for each object by itself, in this process or in another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import Config
from brrp_cli.frames.frame import Frame
from brrp_cli.observation.support_plane import Plane
from brrp_cli.prior.store import Prior
from brrp_cli.retrieval.aligned import Aligner
from brrp_cli.retrieval.illuminants import lights
from brrp_cli.retrieval.observed_appearance import see_object
from brrp_cli.retrieval.placed_objects import PlacedObjects
from brrp_cli.retrieval.score_fusion import Similarity, by_shape, looks_difference
from brrp_cli.retrieval.shortlist import Shortlist, kinds
from brrp_cli.retrieval.similarity import lit_histograms, similarity


class Steps:
    """The steps with one prior, and what they hold in memory. Another process makes its own.

    aligns : whether objects are laid over what is seen, as they are in large priors
    gains : (g, 3) of the lights that are tried
    """

    def __init__(self, prior: Prior, config: Config, seed: int) -> None:
        own = config.retrieval
        self._made_of = prior, config, seed
        self._looks = prior.appearance
        self._shortlist = Shortlist(self._looks.first, own)
        self._aligner = Aligner(prior, own.alignment)
        self.gains = lights(own.illuminants)
        self.aligns = len(prior.names) >= own.alignment.from_objects
        self._similarity = own.similarity
        if not self.aligns:
            self._similarity = replace(own.similarity, blur=0.0, least_pairs=0.0, size_most=np.inf)

    def __reduce__(self) -> tuple[Callable[..., Steps], tuple[Prior, Config, int]]:
        return _steps, self._made_of

    def looked(self, image: SeenImage, object_id: int) -> tuple[Similarity, NDArray[np.float64]]:
        """How alike an object is by its looks, and its points (n, 3)."""
        _, config, _ = self._made_of
        seen = see_object(image.frame, object_id, image.plane, config.retrieval.observed)
        histograms = lit_histograms(seen, self.gains)
        rows = self._shortlist.rows(seen, histograms)
        stored = self._looks.rows(rows)
        look = similarity(seen, histograms, stored, rows, len(self.gains), self._similarity)
        return look, seen.points

    def aligned(
        self,
        image: SeenImage,
        object_id: int,
        look: Similarity,
        likely: NDArray[np.float64],
        points: NDArray[np.float64],
        hasty: bool,
    ) -> Similarity:
        """With the alignment scores of the objects that are `likely` (m,) by their looks; in haste,
        of fewer of them."""
        prior, config, seed = self._made_of
        own = config.retrieval.alignment
        if image.plane is None or len(points) < own.least_points:
            return replace(look, alignment=own.neutral)

        alike = np.argsort(-likely, kind="stable")
        alike = alike[likely[alike] > likely.max() * np.exp(-own.margin)]
        ranked = [alike[kind] for kind in kinds(self._shortlist.plain[look.rows[alike]])]
        shuffled = points[np.random.default_rng(seed).permutation(len(points))]
        seen = self._aligner.on(shuffled, image.frame, object_id, image.plane, image.wave)
        names = [prior.names[row] for row in look.rows]
        placed = PlacedObjects(seen, names, image.wave, config.retrieval)
        fusion = config.retrieval.fusion
        looks = np.log(np.maximum(likely, np.finfo(float).tiny))
        shape = by_shape(look, config.retrieval.likeness)
        counted = looks + looks_difference(look, config.retrieval.likeness, fusion)
        ends = np.cumsum(own.tried[: own.hasty_rounds] if hasty else own.tried).tolist()
        for begin, end in pairwise([0, *ends]):
            # In the prior's order, in which shards hold them.
            tried = np.sort(np.concatenate([kind[begin:end] for kind in ranked]))
            first = placed.tried(tried)
            promise = looks[tried] + own.first * first
            order = tried[np.argsort(-promise, kind="stable")]
            for chosen in (order[: own.most], order[own.most : own.most + own.more]):
                placed.refine(chosen)
                against = fusion.alignment * (1 - placed.agreed) - shape
                if against.min() <= own.certain:
                    break
            left = np.concatenate([kind[end:] for kind in ranked])
            # With a score of 1, the best there is, none of those left would be the most probable.
            best = (counted + fusion.alignment * placed.agreed).max()
            if best > counted[left].max(initial=-np.inf) + fusion.alignment:
                break
            if against.min() <= own.certain:
                break
        promise = looks + own.first * placed.agreed
        promise[placed.alignment <= own.lowest] = -np.inf
        last = np.argsort(-promise, kind="stable")[: own.last]
        last = np.sort(last[np.isfinite(promise[last])])
        placed.finish(last)
        return replace(
            look,
            alignment=placed.alignment,
            bare=placed.bare,
            spilled=placed.spilled,
            wave=image.wave,
        )


@dataclass(frozen=True)
class SeenImage:
    """frame : without strays; plane : of it; wave : metres, by which its depth errs over patches
    (observation/sensor_noise.py)"""

    steps: Steps
    frame: Frame
    plane: Plane | None
    wave: float


def looked(image: SeenImage, object_id: int) -> tuple[Similarity, NDArray[np.float64]]:
    """See `Steps.looked`."""
    return image.steps.looked(image, object_id)


def aligned(
    image: SeenImage,
    object_id: int,
    look: Similarity,
    likely: NDArray[np.float64],
    points: NDArray[np.float64],
    hasty: bool,
) -> Similarity:
    """See `Steps.aligned`."""
    return image.steps.aligned(image, object_id, look, likely, points, hasty)


_last: Steps | None = None


def _steps(prior: Prior, config: Config, seed: int) -> Steps:
    """In another process, which keeps those that it was sent last."""
    global _last
    if _last is None or _last._made_of != (prior, config, seed):
        _last = Steps(prior, config, seed)
    return _last
