"""The posterior of one object's shape when hypotheses about it are its prior."""

from __future__ import annotations

from dataclasses import astuple, dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar, Protocol

import numpy as np
import torch
from numpy.typing import NDArray

from brrp_cli.config.inference import SpreadConfig
from brrp_cli.geometry import as_points, moved_box
from brrp_cli.inference.mean_grid import MeanGrid
from brrp_cli.inference.placed_shape import PlacedShape
from brrp_cli.inference.posterior import LOGISTIC_DEVIATION, HilbertPosterior
from brrp_cli.reconstruction import METRES, Axes

if TYPE_CHECKING:
    import h5py

    from brrp_cli.hdf5 import SharedParts


class MeanFunction(Protocol):
    """What a hypothesis says before the observation corrects it: a logit of occupancy m(x).

    kind : what a file calls the class
    """

    kind: ClassVar[str]

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) metres, camera frame: the box that holds its shape."""

    def logits(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """m (n,) at points (n, 3), metres, camera frame."""

    def volume(self, axes: Axes) -> NDArray[np.float32]:
        """m (nx, ny, nz) on a grid of camera-frame coordinates, metres."""

    def moved(self, T_target_cam: NDArray[np.float64]) -> MeanFunction:
        """The same in another frame, which T_target_cam (4, 4), rigid, leads to."""

    def write(self, group: h5py.Group, shared: SharedParts) -> None:
        """Into a group of its own."""


@dataclass(frozen=True)
class HypothesisPosterior:
    """Particles (hypothesis, weights) over sigmoid(m(x) + w . phi(x)).

    means : m of C hypotheses; which : (P,) the hypothesis of each particle; shares : (P,), sum 1,
    the weight of each particle; correction : the particles' weights w; box : (2, 3) metres, camera
    frame, outside of which nothing is occupied
    common : metres, standard deviation of what the depth that a completed shape was made of is off
    over centimetres: no sample tells of it. A placed shape has it in its pose's covariance.
    spread : what the steepness of occupancy says of a surface's place
    """

    kind: ClassVar[str] = "hypotheses"

    means: tuple[MeanFunction, ...]
    which: NDArray[np.int64]
    shares: NDArray[np.float64]
    correction: HilbertPosterior
    box: NDArray[np.float64]
    common: float = 0.0
    spread: SpreadConfig = field(default_factory=SpreadConfig)

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) metres, camera frame."""
        return self.box

    def moved(self, T_target_cam: NDArray[np.float64]) -> HypothesisPosterior:
        """The same in another frame, which T_target_cam (4, 4), rigid, leads to. Its box is the one
        around this one's."""
        return replace(
            self,
            means=tuple(mean.moved(T_target_cam) for mean in self.means),
            correction=self.correction.moved(T_target_cam),
            box=moved_box(T_target_cam, self.box),
        )

    @property
    def weights(self) -> NDArray[np.float64]:
        """(C,) weight of each hypothesis, sum 1."""
        return np.bincount(self.which, self.shares, len(self.means)).astype(np.float64)

    @property
    def dominant(self) -> int | None:
        """The placed shape that explains the object: the most probable placement, if placements of
        its object together weigh more than a half, or those of all kin."""
        of: dict[str, float] = {}
        for mean, weight in zip(self.means, self.weights, strict=True):
            if isinstance(mean, PlacedShape):
                of[mean.taken_for] = of.get(mean.taken_for, 0.0) + float(weight)
        best = max(of, key=lambda name: of[name], default=None)
        if best is None or of[best] <= 0.5:
            return None
        mine = [isinstance(m, PlacedShape) and m.taken_for == best for m in self.means]
        return int(np.argmax(np.where(mine, self.weights, -1)))

    @property
    def guessed_weight(self) -> float:
        """Weight of what is no stored object as it is: kin and completed shapes."""
        known = [isinstance(m, PlacedShape) and not m.kin for m in self.means]
        return float(self.weights[~np.array(known)].sum())

    def object_weight(self, number: int) -> float:
        """Weight of all placements of the object that hypothesis `number` places, or of all kin."""
        name = getattr(self.means[number], "taken_for", None)
        mine = [isinstance(m, PlacedShape) and m.taken_for == name for m in self.means]
        return float(self.weights[mine].sum())

    def heaviest(self) -> HypothesisPosterior:
        """What it would be if the hypothesis with the greatest weight were right."""
        number = int(np.argmax(self.weights))
        of = self.which == number
        return replace(
            self,
            means=(self.means[number],),
            which=np.zeros(int(of.sum()), np.int64),
            shares=self.shares[of] / self.shares[of].sum(),
            correction=replace(self.correction, weights=self.correction.weights[of]),
        )

    def logits(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """m + w . phi (P, n) at points (n, 3), metres, camera frame."""
        return np.asarray(self._means(points) + self.correction.logits(points))

    def _means(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """m of each particle's hypothesis (P, n) at points (n, 3)."""
        return np.stack([mean.logits(points) for mean in self.means])[self.which]

    def probability(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Occupancy probability (n,): mean over particles of sigmoid(m + w . phi); 0 out of
        bounds. Errors: BrrpError for what are no points (n, 3)."""
        points = as_points(points)
        inside = self._inside(points)
        found = np.zeros(len(points), np.float32)
        found[inside] = self.mean_occupancy(self.logits(points[inside]))
        return found

    def _inside(self, points: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Which of points (n, 3) lie within the bounds."""
        inside: NDArray[np.bool_] = ((points >= self.box[0]) & (points <= self.box[1])).all(axis=1)
        return inside

    def probability_volume(self, axes: Axes) -> NDArray[np.float32]:
        """Occupancy probability (nx, ny, nz) on a grid of camera-frame coordinates, metres."""
        return np.tensordot(self.shares.astype(np.float32), self.particle_volumes(axes), axes=1)

    def particle_volumes(self, axes: Axes) -> NDArray[np.float32]:
        """Occupancy (P, nx, ny, nz) of each particle on a grid of camera-frame coordinates,
        metres."""
        logits = self.correction.logit_volume(axes)
        for number, mean in enumerate(self.means):
            volume = mean.volume(axes)
            for particle in np.flatnonzero(self.which == number):
                logits[particle] += volume
        return np.asarray(torch.from_numpy(logits).sigmoid_().numpy())

    def mean_occupancy(self, logits: NDArray[np.floating]) -> NDArray[np.float32]:
        """Weighted mean over particles of sigmoid(logits), for logits (P, ...)."""
        occupancy = torch.sigmoid(torch.from_numpy(np.asarray(logits, dtype=np.float32)))
        shares = torch.from_numpy(self.shares.astype(np.float32))
        return np.asarray(torch.tensordot(shares, occupancy, dims=1).numpy())

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

        Occupancy falls from 1 to 0 across a surface: the more slowly, the less is known where. The
        correction, whose kernels are centimetres wide, stays what it is on the way. What the depth
        behind a completed shape has in `common` is added in squares.
        """
        correction = self.correction.logits(vertices)

        def occupied(points: NDArray[np.floating]) -> NDArray[np.float32]:
            inside = self._inside(points)
            found = np.zeros(len(points), np.float32)
            logits = self._means(points[inside]) + correction[:, inside]
            found[inside] = self.mean_occupancy(logits)
            return found

        half = self.spread.step
        gradient = [
            (occupied(vertices + step) - occupied(vertices - step)) / (2 * half)
            for step in np.eye(3) * half
        ]
        placed = np.array([isinstance(mean, PlacedShape) for mean in self.means])
        completed = float(self.weights[~placed].sum())
        found = deviation(np.linalg.norm(gradient, axis=0), self.spread)
        return np.hypot(found, np.float32(self.common * np.sqrt(completed)))

    def write(self, group: h5py.Group, shared: SharedParts) -> None:
        """The correction as its class writes it, and which (P,) int64, shares (P,) float64, box (2,
        3), means/0, 1, ... as their classes write them, with their kind; spread (4,) where it is
        not the usual one."""
        self.correction.write(group, shared)
        group.attrs["box"] = self.box
        group.attrs["common"] = self.common
        if self.spread != SpreadConfig():
            group.attrs["spread"] = astuple(self.spread)
        for name, values in (("which", self.which), ("shares", self.shares)):
            group.create_dataset(name, data=values, chunks=values.shape, fletcher32=True)
        for number, mean in enumerate(self.means):
            part = group.create_group(f"means/{number}")
            part.attrs["kind"] = mean.kind
            mean.write(part, shared)

    @classmethod
    def read(cls, group: h5py.Group, shared: SharedParts) -> HypothesisPosterior:
        """What `write` wrote. Errors: KeyError, ValueError."""
        parts = [group[f"means/{number}"] for number in range(len(group["means"]))]
        means = tuple(_KINDS[part.attrs["kind"]].read(part, shared) for part in parts)
        which = np.asarray(group["which"], dtype=np.int64)
        shares = np.asarray(group["shares"], dtype=np.float64)
        if not len(which) or which.min() < 0 or which.max() >= len(means):
            raise ValueError(f"particles of hypotheses that are not there: {which.tolist()}")
        return HypothesisPosterior(
            means,
            which,
            shares,
            HilbertPosterior.read(group, shared),
            np.asarray(group.attrs["box"], dtype=np.float64),
            float(group.attrs["common"]),
            _spread_of(group),
        )


_KINDS: dict[str, type[MeanGrid] | type[PlacedShape]] = {
    each.kind: each for each in (MeanGrid, PlacedShape)
}


def _spread_of(group: h5py.Group) -> SpreadConfig:
    """Errors: ValueError."""
    if "spread" not in group.attrs:
        return SpreadConfig()
    steep, growth, most, step = (float(each) for each in group.attrs["spread"])
    return SpreadConfig(steep, growth, most, step)


def deviation(steepness: NDArray[np.floating], config: SpreadConfig) -> NDArray[np.float32]:
    """Standard deviation (n,), metres, of the place of a surface across which occupancy falls by
    `steepness` (n,), 1/metre: that of a logistic function, which is steepest by a quarter of its
    logit, as far as `config` lets it be that."""
    with np.errstate(divide="ignore"):
        found = LOGISTIC_DEVIATION / (4 * steepness)
    steep = config.steep
    told = np.where(found < steep, found, steep * (found / steep) ** config.growth)
    return np.asarray(np.minimum(told, config.most), dtype=np.float32)
