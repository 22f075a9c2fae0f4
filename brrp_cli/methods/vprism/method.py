"""V-PRISM: all objects of a scene in one probabilistic multi-class map, without a prior.

Wright, Zhi, Johnson-Roberson and Hermans, "V-PRISM: Probabilistic Mapping of Unknown Tabletop
Scenes", 2024 (arXiv 2403.08106); the baseline of the paper's experiments.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, field
from time import perf_counter
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import CoarseToFineConfig, VPrismConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import as_points
from brrp_cli.methods.base import Setup
from brrp_cli.methods.coarse_to_fine import coarse_to_fine_volume
from brrp_cli.methods.configuration import as_record
from brrp_cli.methods.each_object import surfaced, too_few
from brrp_cli.methods.vprism.expected_softmax import expected_softmax
from brrp_cli.methods.vprism.hinge_points import scene_hinges
from brrp_cli.methods.vprism.kernel_features import KernelBasis
from brrp_cli.methods.vprism.map_file import read_map, write_map
from brrp_cli.methods.vprism.softmax_map import SoftmaxMap, fit_softmax_map
from brrp_cli.observation.scene_samples import FREE, SceneSamples, sample_scene
from brrp_cli.progress import progress
from brrp_cli.reconstruction import (
    LOGIT_VARIANCE,
    OK,
    Axes,
    ObjectReconstruction,
    Reconstruction,
)
from brrp_cli.seeds import child_rng

if TYPE_CHECKING:
    import h5py

    from brrp_cli.hdf5 import SharedParts

NAME = "vprism"


@dataclass(frozen=True)
class VPrismPosterior:
    """One object's class in the scene's map; an OccupancyPosterior.

    `label` is the object's class in `scene`, which all objects of a scene share.
    """

    kind: ClassVar[str] = "vprism"

    scene: SoftmaxMap
    label: int
    bounds: NDArray[np.float64]
    grid: CoarseToFineConfig = field(default_factory=CoarseToFineConfig)

    def probability(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Probability (n,) that points (n, 3), metres, camera frame, belong to this object."""
        points = as_points(points)
        inside = ((points >= self.bounds[0]) & (points <= self.bounds[1])).all(axis=1)
        classes = list(range(len(self.scene.mean)))
        mean, variance = self.scene.logits(points[inside], classes)
        result = np.zeros(len(points), dtype=np.float32)
        result[inside] = expected_softmax(mean, variance, self.label)
        return result

    def probability_volume(self, axes: Axes) -> NDArray[np.float32]:
        """`probability` (nx, ny, nz) on a grid of camera-frame coordinates, metres; between
        nodes where nothing is likely."""
        return coarse_to_fine_volume(self.probability, axes, self.grid)

    @property
    def surface_unit(self) -> str:
        """Unit of `surface_uncertainty`."""
        return LOGIT_VARIANCE

    def surface_uncertainty(self, vertices: NDArray[np.floating]) -> NDArray[np.float32]:
        """`uncertainty` (n,) at vertices (n, 3)."""
        return self.uncertainty(vertices)

    def uncertainty(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Variance (n,) of this object's logit against that of free space."""
        _, variance = self.scene.logits(as_points(points), [FREE, self.label])
        return variance.sum(axis=0).astype(np.float32)

    def write(self, group: h5py.Group, shared: SharedParts) -> None:
        """Attributes map (the name of the scene's map among what is shared), label (the object's
        class), bounds (2, 3) and grid (step, empty)."""
        group.attrs["map"] = shared.write("map", self.scene, write_map)
        group.attrs["label"] = self.label
        group.attrs["bounds"] = self.bounds
        group.attrs["grid"] = astuple(self.grid)

    @classmethod
    def read(cls, group: h5py.Group, shared: SharedParts) -> VPrismPosterior:
        """What `write` wrote. Errors: KeyError, ValueError."""
        scene = shared.read(str(group.attrs["map"]), read_map)
        label = int(group.attrs["label"])
        if not 0 < label < len(scene.mean):
            raise ValueError(f"class {label} of {len(scene.mean)}")
        bounds = np.asarray(group.attrs["bounds"], dtype=np.float64)
        step, empty = group.attrs["grid"]
        return VPrismPosterior(scene, label, bounds, CoarseToFineConfig(int(step), float(empty)))


def run(frame: Frame, setup: Setup) -> Reconstruction:
    """Every object of the frame, on the CPU. The same seed gives the same bytes."""
    config = setup.config
    assert isinstance(config, VPrismConfig)
    start = perf_counter()
    scene = sample_scene(frame, config.observation, setup.seed)
    seconds = {"observation": perf_counter() - start}
    found = reconstruct_scene(scene, config, setup.seed)
    return Reconstruction(
        frame=frame,
        objects=[surfaced(item, config.surface) for item in progress(found, "surfaces")],
        plane=scene.plane,
        method=NAME,
        retriever=None,
        prior_path=None,
        prior_digest=None,
        configuration=as_record(config),
        seed=setup.seed,
        device="cpu",
        seconds=seconds,
    )


def reconstruct_scene(
    scene: SceneSamples, config: VPrismConfig, seed: int
) -> list[ObjectReconstruction]:
    """Occupancy of every object, by id, ascending, from the samples of its scene.

    Objects with too few points for a class come back with that status.
    """
    start = perf_counter()
    found = [too_few(i, n, config.observation.min_points) for i, n in scene.too_few.items()]
    if scene.points:
        fitted = fit_scene(scene, config, seed)
        seconds = {"inference": (perf_counter() - start) / len(scene.points)}
        found += [
            ObjectReconstruction(
                object_id=object_id,
                status=OK,
                n_points=len(points),
                center=scene.centers[object_id],
                observed=points,
                posterior=VPrismPosterior(
                    fitted,
                    label,
                    _box(scene.centers[object_id], config.half_width),
                    config.grid,
                ),
                seconds=dict(seconds),
            )
            for label, (object_id, points) in enumerate(scene.points.items(), start=FREE + 1)
        ]
    return sorted(found, key=lambda each: each.object_id)


def fit_scene(scene: SceneSamples, config: VPrismConfig, seed: int) -> SoftmaxMap:
    """The map of all classes: FREE, then the scene's objects by id."""
    hinges = scene_hinges(
        scene.points,
        scene.centers,
        spacing=config.hinge_spacing,
        radius=config.hinge_radius,
        surface=config.surface_hinges,
        seed=seed,
    )
    return fit_softmax_map(
        scene.samples,
        scene.labels,
        1 + len(scene.points),
        KernelBasis(hinges, config.gamma, config.feature_floor),
        prior_variance=config.prior_variance,
        iterations=config.iterations,
        max_points=config.max_update_points,
        rng=child_rng(seed, "updates"),
    )


def _box(center: NDArray[np.float64], half_width: float) -> NDArray[np.float64]:
    return np.stack([center - half_width, center + half_width])
