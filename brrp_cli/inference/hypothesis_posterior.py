"""The posterior of one object's shape when hypotheses about it are its prior."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from brrp_cli.inference.posterior import HilbertPosterior, mean_occupancy, occupancy
from brrp_cli.inference.prior_mean import PriorMeanGrid
from brrp_cli.reconstruction import METRES, Axes

if TYPE_CHECKING:
    import h5py

    from brrp_cli.hdf5 import SharedParts

# Standard deviation of the logistic distribution over 4: a surface whose occupancy is a logistic
# function of the way across it has this over the gradient as standard deviation of its place.
LOGISTIC = np.pi / np.sqrt(3) / 4
# No surface is less certain than this, metres.
LARGEST = 0.05
# Half of the difference quotients' step, metres.
STEP = 0.001


@dataclass(frozen=True)
class HypothesisPosterior:
    """Particles (hypothesis, weights) over sigmoid(m(x) + w . phi(x)).

    mean : m of C hypotheses; which : (P,) the hypothesis of each particle; correction : the
    particles' weights
    """

    kind: ClassVar[str] = "hypotheses"

    mean: PriorMeanGrid
    which: NDArray[np.int64]
    correction: HilbertPosterior

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) metres, camera frame: the grid's box, outside of which nothing is occupied."""
        return np.stack([self.mean.lower, self.mean.upper])

    def logits(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """m + w . phi (P, n) at points (n, 3), metres, camera frame."""
        return self.mean.logits(points)[self.which] + self.correction.logits(points)

    def probability(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Occupancy probability (n,): mean over particles of sigmoid(m + w . phi)."""
        return mean_occupancy(self.logits(points))

    def probability_volume(self, axes: Axes) -> NDArray[np.float32]:
        """Occupancy probability (nx, ny, nz) on a grid of camera-frame coordinates, metres."""
        logits = self.mean.volume(axes)[self.which] + self.correction.logit_volume(axes)
        return mean_occupancy(logits)

    def uncertainty(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Variance (n,) of occupancy, p (1 - p): at most 0.25, between the hypotheses' surfaces."""
        p = self.probability(points)
        return p * (1 - p)

    @property
    def surface_unit(self) -> str:
        """Unit of `surface_uncertainty`."""
        return METRES

    def surface_uncertainty(self, vertices: NDArray[np.floating]) -> NDArray[np.float32]:
        """Standard deviation (n,), metres, of the surface's place at its vertices (n, 3).

        Occupancy falls from 1 to 0 across a surface: the more slowly, the less is known where.
        """
        slope = [
            (self.probability(vertices + step) - self.probability(vertices - step)) / (2 * STEP)
            for step in np.eye(3) * STEP
        ]
        steepness = np.maximum(np.linalg.norm(slope, axis=0), LOGISTIC / LARGEST)
        return np.asarray(LOGISTIC / steepness, dtype=np.float32)

    def particle_volumes(self, axes: Axes) -> NDArray[np.float32]:
        """Occupancy probability (P, nx, ny, nz) of each particle on a grid."""
        return occupancy(self.mean.volume(axes)[self.which] + self.correction.logit_volume(axes))

    def write(self, group: h5py.Group, shared: SharedParts) -> None:
        """The correction as its class writes it, and attributes mean_lower (3), mean_spacing,
        outside; mean (C, nx, ny, nz) float16, logits; which (P,) int64."""
        self.correction.write(group, shared)
        group.attrs["mean_lower"] = self.mean.lower
        group.attrs["mean_spacing"] = self.mean.spacing
        group.attrs["outside"] = self.mean.outside
        group.create_dataset(
            "mean",
            data=self.mean.values,
            chunks=(1, *self.mean.values.shape[1:]),
            compression="gzip",
            shuffle=True,
            fletcher32=True,
        )
        group.create_dataset("which", data=self.which, chunks=self.which.shape, fletcher32=True)

    @classmethod
    def read(cls, group: h5py.Group, shared: SharedParts) -> HypothesisPosterior:
        """What `write` wrote. Errors: KeyError, ValueError."""
        mean = PriorMeanGrid(
            lower=np.asarray(group.attrs["mean_lower"], dtype=np.float64),
            spacing=float(group.attrs["mean_spacing"]),
            values=np.asarray(group["mean"], dtype=np.float16),
            outside=float(group.attrs["outside"]),
        )
        which = np.asarray(group["which"], dtype=np.int64)
        return HypothesisPosterior(mean, which, HilbertPosterior.read(group, shared))
