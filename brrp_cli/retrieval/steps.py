"""What retrieval by appearance does for each object by itself, in this process or in another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import Config
from brrp_cli.config.retrieval import RetrievalConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.observation.support_plane import Plane
from brrp_cli.prior.store import Prior
from brrp_cli.retrieval.aligned import SeenPart, Shares, seen_part
from brrp_cli.retrieval.held_models import HeldModels
from brrp_cli.retrieval.illuminants import lights
from brrp_cli.retrieval.observed_appearance import see_object
from brrp_cli.retrieval.placed_objects import PlacedObjects
from brrp_cli.retrieval.rounds import Rounds, alike
from brrp_cli.retrieval.score_fusion import Similarity, against_silhouettes
from brrp_cli.retrieval.shortlist import Shortlist
from brrp_cli.retrieval.similarity import lit_histograms, similarity


class Steps:
    """The steps with one prior, and what they hold in memory. Another process makes its own.

    gains : (g, 3) of the lights that are tried
    """

    def __init__(self, prior: Prior, config: Config, seed: int) -> None:
        own = config.retrieval
        self._made_of = prior, config, seed
        self._looks = prior.appearance
        self._shortlist = Shortlist(self._looks.first, own)
        self._models = HeldModels(prior, own.alignment)
        self.gains = lights(own.illuminants)

    def __reduce__(self) -> tuple[Callable[..., Steps], tuple[Prior, Config, int]]:
        return _steps, self._made_of

    def looked(self, image: SeenImage, object_id: int) -> tuple[Similarity, NDArray[np.float64]]:
        """How alike an object is by its looks, and its points (n, 3)."""
        _, config, _ = self._made_of
        seen = see_object(image.frame, object_id, image.plane, config.retrieval.observed)
        histograms = lit_histograms(seen, self.gains)
        # The first look compares hues.
        rows = self._shortlist.rows(seen, None if seen.hueless else histograms)
        stored = self._looks.rows(rows)
        look = similarity(
            seen, histograms, stored, rows, len(self.gains), config.retrieval.similarity
        )
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
        own, steering = config.retrieval.alignment, config.retrieval.steering
        if image.plane is None:
            return replace(look, alignment=own.neutral)

        def against(bare: Shares, spilled: Shares) -> Shares:
            nats = against_silhouettes(bare, spilled, image.wave, steering)
            return nats / max(steering.alignment, 1.0)

        shuffled = points[np.random.default_rng(seed).permutation(len(points))]
        seen = seen_part(
            shuffled,
            image.frame,
            object_id,
            image.plane,
            image.wave,
            self._models,
            own,
            against,
        )
        names = [prior.names[row] for row in look.rows]
        if len(points) < own.least_points:
            rows = np.sort(alike(likely, own.margin))
            return _by_mask(look, rows, seen, names, image.wave, config.retrieval)
        placed = PlacedObjects(seen, names, against, own)
        plain = self._shortlist.plain[look.rows]
        Rounds(placed, look, likely, plain, config.retrieval).run(hasty)
        return replace(
            look,
            alignment=placed.alignment,
            bare=placed.bare,
            spilled=placed.spilled,
            wave=image.wave,
        )


def _by_mask(
    look: Similarity,
    rows: NDArray[np.int64],
    seen: SeenPart,
    names: Sequence[str],
    wave: float,
    config: RetrievalConfig,
) -> Similarity:
    """With the silhouettes of some objects (r,) of `names` that are placed by the mask alone; the
    others count as not at all like it. In the prior's order, in which shards hold them."""
    fusion = config.fusion
    bare = np.full(len(names), fusion.most_bare, np.float32)
    spilled = np.ones(len(names), np.float32)
    bare[rows], spilled[rows] = seen.silhouettes_by_mask([names[row] for row in rows])
    return replace(look, alignment=config.alignment.neutral, bare=bare, spilled=spilled, wave=wave)


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
