"""What every method gives back: for each object, occupancy probability at points."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

OK = "ok"
TOO_FEW_POINTS = "too_few_points"
NO_SURFACE = "no_surface"
FAILED = "failed"


class OccupancyPosterior(Protocol):
    """A distribution over one object's shape, in the camera frame.

    `bounds` is the box outside of which the method says nothing and occupancy counts as 0.
    """

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) metres, camera frame: lower and upper corner."""

    def probability(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Occupancy probability (n,) at points (n, 3), metres, camera frame."""

    def uncertainty(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """How unsure (n,), >= 0, in the method's own unit (BRRP: variance of the logits)."""


@dataclass
class Retrieved:
    """One stored object that was retrieved for one seen object.

    T_cam_object maps the stored object's normalised coordinates to the camera frame (a
    similarity); None where registration found no inlier. fitness: share of observed points with
    an inlier, 0 to 1.
    """

    name: str
    probability: float
    T_cam_object: NDArray[np.float64] | None = None
    scale: float | None = None
    inliers: int = 0
    fitness: float = 0.0


@dataclass
class ObjectReconstruction:
    """What is known of one object after inference. `posterior` is None unless status is "ok"."""

    object_id: int
    status: str
    message: str = ""
    n_points: int = 0
    center: NDArray[np.float64] | None = None
    observed: NDArray[np.float32] | None = None
    retrieved: list[Retrieved] = field(default_factory=list)
    posterior: OccupancyPosterior | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    extra: dict[str, Any] = field(default_factory=dict)
