"""What earlier frames of a stream showed of one object at rest, brought to the present camera.

Views of a thing at rest are views of one thing: its pose is fitted to the rays of all of them, each
cast from its own camera, its likelihood is that of all of them, and samples of free and occupied
space join. What a single view says of an unknown shape, the network's logits, is averaged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from brrp_cli.completion.completed_mean import empty_space
from brrp_cli.completion.seen_surface import Bounds, SeenSurface
from brrp_cli.config import HypothesesConfig, MeanConfig
from brrp_cli.config.tracking import SharpenConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import inverse, normalise, transform_points
from brrp_cli.kin.evidence import OtherDepth
from brrp_cli.methods.base import EarlierView
from brrp_cli.observation.soft_samples import SoftSamples
from brrp_cli.observation.support_plane import Plane
from brrp_cli.prior.store import Prior
from brrp_cli.registration.likelihood import SeenPixels
from brrp_cli.registration.model import search_model
from brrp_cli.registration.pose_search import Hypothesis, start_from
from brrp_cli.registration.ray_refinement import OtherRays
from brrp_cli.registration.verification import Verifier
from brrp_cli.registration.views import SeenFrom

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PlacedEarlier:
    """A stored object as it was placed: T_cam_model (4, 4), scale, alignment score and weight, as
    of `Hypothesis` and the posterior."""

    name: str
    T_cam_model: Array
    scale: float
    alignment_score: float
    weight: float

    @classmethod
    def of(cls, hypothesis: Hypothesis, weight: float) -> PlacedEarlier:
        """What a later frame needs of a placement."""
        return cls(
            hypothesis.model.stored.name,
            hypothesis.T_cam_model,
            hypothesis.scale,
            hypothesis.alignment_score,
            weight,
        )


@dataclass(frozen=True)
class Guess:
    """What the network thought: logits (nx, ny, nz) at lower + spacing * (i, j, k), metres, camera
    frame; NaN where space is empty."""

    lower: Array
    spacing: float
    values: NDArray[np.float16]

    def logits(self, points: Array) -> tuple[Array, NDArray[np.bool_]]:
        """(n,) at points (n, 3), and where it thought anything."""
        at = ((points - self.lower) / self.spacing).T
        told = np.isfinite(self.values)
        share = map_coordinates(told.astype(np.float32), at, order=1, mode="constant")
        values = np.where(told, self.values, 0).astype(np.float32)
        total = map_coordinates(values, at, order=1, mode="constant")
        # Most of what it would be interpolated from.
        known = share > 0.5
        return np.where(known, total / np.where(known, share, 1), 0), known


@dataclass(frozen=True)
class Remembered:
    """One object in one frame, metres, in that frame's camera frame.

    points : (n, 3) in random order; seen, samples, wave, plane : of the object and its frame, as
    inference had them, the samples thinned; probabilities : P(c|R) (n,); placed : its hypotheses;
    ratios : name -> log likelihood ratio, nats, of this view alone; alone : the object has moved
    since earlier views of it
    """

    frame: Frame
    object_id: int
    plane: Plane | None
    points: Array
    seen: SeenPixels
    samples: SoftSamples
    wave: float
    probabilities: Array
    placed: tuple[PlacedEarlier, ...]
    ratios: dict[str, float]
    guess: Guess | None
    surface: SeenSurface
    alone: bool


def thinned(samples: SoftSamples, most: int, rng: np.random.Generator) -> SoftSamples:
    """At most so many of the samples, drawn at random."""
    rows = rng.permutation(len(samples.points))[:most]
    return SoftSamples(samples.points[rows], samples.targets[rows], samples.measured[rows])


@dataclass(frozen=True)
class MovedView:
    """T_now_then, T_then_now : (4, 4) rigid, between that frame's camera and the present one's"""

    T_now_then: Array
    T_then_now: Array
    memory: Remembered


@dataclass(frozen=True)
class EarlierViews:
    """Earlier views of one object, oldest first, maybe none, for the present frame."""

    views: tuple[MovedView, ...]
    config: SharpenConfig

    @classmethod
    def of(cls, views: Sequence[EarlierView], config: SharpenConfig) -> EarlierViews:
        """What the stream says of one object."""
        return cls(
            tuple(
                MovedView(
                    v.T_now_then,
                    inverse(v.T_now_then),
                    cast(Remembered, v.memory),
                )
                for v in views
            ),
            config,
        )

    def __bool__(self) -> bool:
        return bool(self.views)

    def lost(self, config: HypothesesConfig) -> frozenset[str]:
        """The stored objects that had no weight left in the last frame."""
        if not self.views:
            return frozenset()
        last, least = self.views[-1].memory, config.map.least_weight
        tried = {name for view in self.views for name in view.memory.ratios}
        return frozenset(tried - {p.name for p in last.placed if p.weight >= least})

    def hopeless(self) -> frozenset[str]:
        """Those that `config.twice` views speak against, each by `config.against` nats."""
        every = [
            name
            for view in self.views
            for name, nats in view.memory.ratios.items()
            if nats < -self.config.against
        ]
        return frozenset(name for name in every if every.count(name) >= self.config.twice)

    def probabilities(self, found: Array) -> Array:
        """P(c|R) (n,), the mean of all views, of the present one's `found` (n,)."""
        return np.mean([found, *(view.memory.probabilities for view in self.views)], axis=0)

    def points(self) -> list[Array]:
        """Observed points (n, 3) of each, metres, camera frame."""
        return [_moved(v.T_now_then, v.memory.points) for v in self.views]

    def rays(self) -> list[OtherRays]:
        """Of each, for refining a placement."""
        return [
            OtherRays(
                v.memory.points,
                float(v.memory.frame.K[0, 0]),
                v.memory.wave,
                v.T_then_now,
            )
            for v in self.views
        ]

    def seen(self) -> tuple[SeenFrom, ...]:
        """Of each, for weighing a placement."""
        return tuple(SeenFrom(v.memory.seen, v.T_then_now) for v in self.views)

    def depths(self) -> list[OtherDepth]:
        """Of each, for what cannot be in space that it saw to be free."""
        return [OtherDepth(v.memory.frame, v.memory.object_id, v.T_then_now) for v in self.views]

    def votes(self, center: Array) -> float:
        """How many views of an object about `center` (3,), the present one with them, err
        independently: those from one side have the errors of the stored mesh in common."""
        directions = [normalise(-center)]
        count = 1.0
        for view in reversed(self.views):
            toward = normalise(view.T_now_then[:3, 3] - center)
            nearest = np.arccos(np.clip(np.array(directions) @ toward, -1, 1)).min()
            count += min(1.0, float(nearest) / self.config.side)
            directions.append(toward)
        return count

    def joined(self, samples: SoftSamples) -> SoftSamples:
        """The present view's samples and those of all others."""
        moved = [
            SoftSamples(
                _moved(v.T_now_then, v.memory.samples.points),
                v.memory.samples.targets,
                _moved(v.T_now_then, v.memory.samples.measured),
            )
            for v in self.views
        ]
        every = [samples, *moved]
        return SoftSamples(
            *(
                np.concatenate([getattr(each, name) for each in every])
                for name in ("points", "targets", "measured")
            )
        )

    def empty(self, points: Array, config: MeanConfig) -> NDArray[np.bool_]:
        """Which of points (n, 3), metres, camera frame, any of them saw to be empty."""
        found = np.zeros(len(points), bool)
        for view in self.views:
            then, m = _moved(view.T_then_now, points), view.memory
            found |= empty_space(then, m.frame, m.object_id, m.plane, config)
        return found

    def bounds(self, points: Array, shell: float, config: MeanConfig) -> list[Bounds]:
        """Of the logits at points (n, 3), metres, camera frame, by what each of them saw."""
        return [
            v.memory.surface.bounds(_moved(v.T_then_now, points), shell, config) for v in self.views
        ]

    def averaged(self, logits: NDArray[np.float32], points: Array) -> NDArray[np.float32]:
        """The network's logits (n,) at points (n, 3), metres, camera frame: the mean of all views'
        that thought anything."""
        total, count = logits.astype(np.float64), np.ones(len(points))
        for view in self.views:
            if view.memory.guess is not None:
                then = _moved(view.T_then_now, points)
                values, known = view.memory.guess.logits(then)
                total += values
                count += known
        return (total / count).astype(np.float32)

    def begun(
        self, prior: Prior, verifier: Verifier, config: HypothesesConfig
    ) -> dict[str, list[Hypothesis]]:
        """Name -> placements of the last frame, refined to this one, where they are no worse."""
        found: dict[str, list[Hypothesis]] = {}
        if not self.views:
            return found
        view, least = self.views[-1], config.map.least_weight
        for name in dict.fromkeys(p.name for p in view.memory.placed if p.weight >= least):
            mine = [p for p in view.memory.placed if p.name == name and p.weight >= least]
            started = start_from(
                np.stack([view.T_now_then @ p.T_cam_model for p in mine]),
                np.array([p.scale for p in mine]),
                search_model(prior.load(name)),
                verifier,
                config.search,
            )
            best = max(p.alignment_score for p in mine)
            if started and started[0].alignment_score >= best - self.config.worse:
                found[name] = started
        return found

    def agree(self, begun: dict[str, list[Hypothesis]], points: int) -> bool:
        """Whether the object is where its heaviest placement was; True where it had none.

        points : of the model that are compared
        """
        if not self.views:
            return True
        view = self.views[-1]
        was = max(view.memory.placed, key=lambda p: p.weight, default=None)
        # More likely than not is what takes a half of the weight.
        if was is None or was.weight <= 0.5 or was.name not in begun:
            return True
        now = begun[was.name][0]
        surface = _moved(view.T_now_then @ was.T_cam_model, now.model.surface[:points])
        local = _moved(inverse(now.T_cam_model), surface)
        return bool(np.abs(now.model.signed_distance(local)).mean() <= self.config.agree)


# Of a frame that stands alone.
ALONE = EarlierViews((), SharpenConfig())


def _moved(T_target_source: Array, points: NDArray[np.floating]) -> Array:
    return np.asarray(transform_points(T_target_source, points), dtype=np.float64)
