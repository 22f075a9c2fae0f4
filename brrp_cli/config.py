"""Every constant of the method, in two presets.

`paper` holds the constants of the paper and of its authors' implementation; `default` is what
`brrp` uses when nothing else is asked for. The effective configuration is saved beside every
result. Lengths are metres.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from brrp_cli.errors import BrrpError


@dataclass(frozen=True)
class FeatureConfig:
    """Clouds and FPFH features, of stored and of observed objects alike (paper, section IV-A).

    Stored objects are normalised (largest half-extent 1) and multiplied by `base_scale * scale`
    for each scale of the scan.
    """

    base_scale: float = 0.12
    scales: tuple[float, ...] = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.22, 1.34)
    voxel: float = 0.01
    normal_radius: float = 0.02
    normal_neighbours: int = 30
    fpfh_radius: float = 0.05
    fpfh_neighbours: int = 100


@dataclass(frozen=True)
class RegistrationConfig:
    """RANSAC on FPFH matches over the scale scan (paper, section IV-A)."""

    draw: int = 3
    correspondence_distance: float = 0.0075
    edge_length: float = 0.9
    iterations: int = 100_000
    confidence: float = 0.99


@dataclass(frozen=True)
class ObservationConfig:
    """Observed samples: surface, stratified rays, below the plane (paper, section IV-C)."""

    min_points: int = 16
    ray_bin: float = 0.2
    ray_radius: float = 0.2
    max_ray_samples: int = 1_000_000
    plane_radius: float = 0.6
    plane_tolerance: float = 0.01
    plane_iterations: int = 1000
    below_draws: int = 50_000
    below_radius: float = 0.2
    free_cell: float = 0.015
    surface_cell: float = 0.01


@dataclass(frozen=True)
class InferenceConfig:
    """Hilbert map and SVGD (paper, sections III-A, III-B and IV-D)."""

    hinges_per_axis: int = 12
    hinge_half_width: float = 0.15
    feature_floor: float = 1e-7
    particles: int = 8
    learning_rate: float = 0.1
    epochs: int = 10
    observed_batch: int = 2048
    prior_batch: int = 256
    lambda_observed: float = 50.0
    lambda_prior: float = 1.0
    lambda_norm: float = 1e-6


@dataclass(frozen=True)
class SurfaceConfig:
    """Marching cubes on the mean occupancy."""

    level: float = 0.5
    spacing: float = 0.005
    # A component of the level set further than this from every observed point is hallucinated.
    keep_distance: float = 0.01


@dataclass(frozen=True)
class Config:
    """The whole method. `preset` names where the values came from."""

    preset: str = "default"
    k: int = 3
    features: FeatureConfig = field(default_factory=FeatureConfig)
    registration: RegistrationConfig = field(default_factory=RegistrationConfig)
    observation: ObservationConfig = field(default_factory=ObservationConfig)
    inference: InferenceConfig = field(default_factory=InferenceConfig)
    surface: SurfaceConfig = field(default_factory=SurfaceConfig)

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON and HDF5."""
        return asdict(self)


PRESETS = {"paper": Config(preset="paper"), "default": Config(preset="default")}


def preset(name: str) -> Config:
    """The configuration of that name."""
    if name not in PRESETS:
        raise BrrpError("No such preset", found=name, expected=", ".join(PRESETS))
    return PRESETS[name]


def _vprism_observation() -> ObservationConfig:
    return ObservationConfig(
        ray_bin=0.1, ray_radius=0.25, plane_radius=0.4, below_draws=1000, below_radius=0.25
    )


@dataclass(frozen=True)
class VPrismConfig:
    """The V-PRISM baseline (Wright et al. 2024, arXiv 2403.08106), as its authors ran it.

    `gamma` is of the kernel exp(-gamma |x - h|^2), 1 / m^2. Two values are not theirs:
    `feature_floor`, under which a feature counts as 0, and `half_width` of the box around an
    object's centre outside of which its occupancy is 0.
    """

    observation: ObservationConfig = field(default_factory=_vprism_observation)
    hinge_spacing: float = 0.05
    hinge_radius: float = 0.15
    surface_hinges: int = 32
    gamma: float = 1000.0
    feature_floor: float = 1e-7
    prior_variance: float = 1e4
    iterations: int = 3
    max_update_points: int = 20_000
    half_width: float = 0.2
