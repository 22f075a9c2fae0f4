"""What a whole frame says for and against many placements of a model at once."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SearchConfig, VerificationConfig
from brrp_cli.distance_loops import explained
from brrp_cli.frames.frame import Frame
from brrp_cli.observation.support_plane import Plane
from brrp_cli.registration.free_space_loops import contradicted
from brrp_cli.registration.model import ModelGeometry
from brrp_cli.registration.outline import Outline, outline
from brrp_cli.registration.seen_mask import SeenMask
from brrp_cli.registration.transform_loops import inverses

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Verifier:
    """One seen object: its points (n, 3), metres, camera frame, in random order, the frame that
    shows it, the plane it stands on, where there is one, and its mask where depth shows too little
    of it."""

    points: Array
    frame: Frame
    plane: Plane | None
    mask: SeenMask | None = None
    _outlines: dict[tuple[int, float, int], Outline] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @property
    def lost(self) -> NDArray[np.bool_] | None:
        """(H, W) the object's pixels that have no depth, where depth shows too little of it."""
        return None if self.mask is None else self.mask.lost

    def outline(self, config: SearchConfig) -> Outline:
        """How the points lie, found once for all models."""
        key = config.box_points, config.stray, config.directions
        if key not in self._outlines:
            self._outlines[key] = outline(self.points, self.plane, config)
        return self._outlines[key]

    def score(
        self,
        T_cam_model: Array,
        model: ModelGeometry,
        config: VerificationConfig,
        *,
        model_points: int,
        seen_points: int,
    ) -> Array:
        """Evidence (B,) of placements T_cam_model (B, 4, 4), similarities; 1 at best.

        For: observed points on the model's surface. Against: observed points far from it, model
        surface in space that the camera saw to be free, model surface below the plane, and what the
        mask says. Each is a share, so that seen and hidden sides, large and small objects are
        judged alike.
        """
        T = np.ascontiguousarray(T_cam_model, dtype=np.float64)
        distances, plane = model.field, self.plane
        like = explained(
            distances.values,
            distances.lower,
            distances.spacing,
            model.half_extent,
            inverses(T),
            self.points[:seen_points],
            config.near,
            config.far,
            config.distance,
        )
        unlike = contradicted(
            T,
            model.surface[:model_points],
            self.frame.depth if self.mask is None else self.mask.depth,
            self.frame.K,
            np.zeros(3) if plane is None else plane.normal,
            np.inf if plane is None else plane.offset,
            config.tolerance,
            config.slope,
        )
        if self.mask is not None:
            like = self.mask.believed(like) - self.mask.against(T, model, config.tolerance)
        return like - config.contradiction * unlike


def in_waves(search: SearchConfig, wave: float) -> SearchConfig:
    """The numbers of a search where depth errs over patches by `wave`, metres: the true object may
    be further off the points and further before what is behind it. A camera that errs by less than
    those numbers allow changes nothing."""
    score, deviation = search.alignment_score, search.waves * wave
    near = max(score.near, deviation)
    tolerant = replace(
        score,
        near=near,
        far=score.far * near / score.near,
        tolerance=max(score.tolerance, deviation),
    )
    return replace(search, alignment_score=tolerant)
