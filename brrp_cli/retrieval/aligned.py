"""Stored objects laid over what is seen: the alignment score of each, for retrieval."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from threading import RLock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SearchConfig, VerificationConfig
from brrp_cli.config.retrieval import AlignmentConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import similarity
from brrp_cli.observation.support_plane import Plane
from brrp_cli.prior.distance_field import DistanceField
from brrp_cli.prior.kept_parts import KeptParts, kept_parts
from brrp_cli.prior.shard import DISTANCES
from brrp_cli.prior.store import Prior
from brrp_cli.registration.begin import coarse_score
from brrp_cli.registration.glance import coarser, glance
from brrp_cli.registration.mask_poses import MaskOutline, mask_outline, poses_from_mask
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
# Models that are held in memory, 0.14 MB each; those of them that were used last as they are
# computed with, 0.28 MB each; and coarser ones, 0.03 MB each.
HELD, READY, HELD_COARSELY = 1024, 128, 4096
# Models that are made coarser at a time; in use, one takes 0.25 MB.
AT_A_TIME = 64
# Objects of the largest prior whose models are kept beside it, 0.14 MB each.
KEPT = 2048


class Aligner:
    """Places stored objects, and holds the models that it read last, or those of all objects as
    they are kept beside the prior."""

    def __init__(self, prior: Prior, config: AlignmentConfig) -> None:
        self._prior = prior
        self._config = config
        self._held: OrderedDict[str, BareModel] = OrderedDict()
        self._ready: OrderedDict[str, BareModel] = OrderedDict()
        self._kept: KeptParts | None = None
        self._sought = False
        # Objects of a frame are retrieved in several threads.
        self._reading = RLock()
        self._coarse: OrderedDict[str, BareModel] = OrderedDict()

    def on(
        self,
        points: NDArray[np.floating],
        frame: Frame,
        object_id: int,
        plane: Plane,
        wave: float,
        against: Against,
    ) -> SeenPart:
        """What objects are laid over: points (n, 3) of an object, metres, camera frame, in random
        order.

        wave : metres, by which the frame's depth errs over patches (observation/sensor_noise.py)
        against : what silhouettes say against placements, in alignment scores
        """
        search = replace(
            self._config.search,
            alignment_score=tolerant(
                self._config.search.alignment_score, self._config.waves * wave
            ),
        )
        verifier = Verifier(points.astype(np.float64), frame, plane)
        own = self._config
        blind = len(points) < own.blind * (frame.segmap == object_id).sum()
        mask = Mask(
            silhouette(frame, object_id, own.silhouette),
            mask_outline(frame, object_id, plane, own.by_mask),
            blind,
        )
        return SeenPart(self, verifier, mask, search, own, against)

    def models(self, names: Sequence[str]) -> list[BareModel]:
        """The models of objects of these names. Errors: PriorError."""
        with self._reading:
            self._read([name for name in names if name not in self._ready])
            found = [self._ready[name] for name in names]
            for name in names:
                self._ready.move_to_end(name)
            _let_go(self._ready, READY)
            return found

    def coarse_models(self, names: Sequence[str]) -> list[BareModel]:
        """The same, as `glance` needs them. Errors: PriorError."""
        points = self._config.glance.model_points
        with self._reading:
            new = [name for name in names if name not in self._coarse]
            if 2 * len(new) > len(self._prior.names):
                # As good as all have to be read, so they are kept for the next command.
                self._seek(make=True)
            for start in range(0, len(new), AT_A_TIME):
                some = new[start : start + AT_A_TIME]
                self._coarse |= {
                    name: coarser(model, points)
                    for name, model in zip(some, self.models(some), strict=True)
                }
            found = [self._coarse[name] for name in names]
            for name in names:
                self._coarse.move_to_end(name)
            _let_go(self._coarse, HELD_COARSELY)
            return found

    def _read(self, names: Sequence[str]) -> None:
        """Make models of these names ready."""
        if not names:
            return
        self._seek(make=False)
        points = self._config.search.fine_points
        if self._kept is not None:
            self._ready |= {name: bare_model(self._kept.of(name), points) for name in names}
            return
        new = [name for name in names if name not in self._held]
        for name, arrays in self._prior.parts(new, PARTS):
            self._held[name] = _with_values(bare_model(arrays, points), np.float16)
        for name in names:
            self._ready[name] = _with_values(self._held[name], np.float32)
            self._held.move_to_end(name)
        _let_go(self._held, HELD)

    def _seek(self, *, make: bool) -> None:
        """Look once for what is kept beside the prior, or make it."""
        done = self._kept is not None or (self._sought and not make)
        if done or len(self._prior.names) > KEPT:
            return
        self._sought = True
        self._kept = kept_parts(self._prior, PARTS, self._config.search.fine_points, make=make)
        if self._kept is not None:
            self._held.clear()


def _let_go(held: OrderedDict[str, BareModel], most: int) -> None:
    """Of what was not used for longest, until so many are left."""
    while len(held) > most:
        held.popitem(last=False)


def _with_values(model: BareModel, kind: type[np.floating]) -> BareModel:
    """With distances in another precision: they are kept in the one in which they are stored, half
    the memory of that in which they are computed with."""
    field = model.field
    return replace(model, field=replace(field, values=field.values.astype(kind)))


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
        aligner: Aligner,
        verifier: Verifier,
        mask: Mask,
        search: SearchConfig,
        config: AlignmentConfig,
        against: Against,
    ) -> None:
        self._aligner = aligner
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
        models = self._aligner.coarse_models(names)
        search = replace(self._config.glance, alignment_score=self._search.alignment_score)
        return np.array([glance(model, self._verifier, search) for model in models])

    def first_scores(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Alignment scores (m,) of the objects of these names after the first few steps; of what
        depth shows a part of, less what their silhouettes say against them. Errors: PriorError."""
        found = []
        for name, model in zip(names, self._aligner.models(names), strict=True):
            first, against = self._begun(model)
            self._first[name] = first
            found.append(first.score - against)
        return np.array(found)

    def scores(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Alignment scores (m,) of objects that `first_scores` was asked for."""
        models = self._aligner.models(names)
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
        for name, model in zip(names, self._aligner.models(names), strict=True):
            placed = self._placed[name].first(self._search.fine)
            placed = finely(self._agreeing(placed, model), model, self._verifier, search)
            self._placed[name] = self._agreeing(placed, model)
        return np.array([self._placed[name].score for name in names])

    def silhouettes(self, names: Sequence[str]) -> NDArray[np.float64]:
        """(2, m) of the placements of objects that `scores` was asked for: shares of the mask that
        they leave bare, and cover beside it (registration/silhouette.py)."""
        models = self._aligner.models(names)
        found = [
            self._shares(self._placed[name].T_cam_model[:1], model)
            for name, model in zip(names, models, strict=True)
        ]
        return np.concatenate([np.zeros((2, 0)), *found], axis=1)

    def silhouettes_by_mask(self, names: Sequence[str]) -> NDArray[np.float64]:
        """The same (2, m) of the placements that the mask alone suggests; all of it, of an object
        that rests in no pose. Errors: PriorError."""
        found = np.ones((2, len(names)))
        for row, model in enumerate(self._aligner.models(names)):
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
