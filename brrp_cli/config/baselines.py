"""The baselines: V-PRISM and PointSDF. Lengths are metres."""

from __future__ import annotations

from dataclasses import dataclass, field

from brrp_cli.config.observation import ObservationConfig, StrayConfig
from brrp_cli.config.ranges import share
from brrp_cli.config.surface import SurfaceConfig


def _vprism_observation() -> ObservationConfig:
    return ObservationConfig(
        ray_bin=0.1, ray_radius=0.25, plane_radius=0.4, below_draws=1000, below_radius=0.25
    )


@dataclass(frozen=True)
class CoarseToFineConfig:
    """A grid is evaluated at every `step`-th node first, and at all nodes only where one of the
    corners around is likelier than `empty` to be occupied."""

    step: int = 3
    empty: float = share(0.02)


@dataclass(frozen=True)
class PointSDFConfig:
    """The PointSDF baseline: what is asked of a trained network.

    surface : its level is the paper's; observation : only what finds the support plane
    strays : what is left out of each mask: one pixel far behind moves the box that a cloud is
    centred on
    half_width : of the box around the middle of what was seen outside of which occupancy is 0
    largest_deviation : metres; no surface is less certain than this; difference_step : metres, of
    difference quotients across the surface
    """

    surface: SurfaceConfig = field(
        default_factory=lambda: SurfaceConfig(level=0.3, one_piece=False)
    )
    observation: ObservationConfig = field(default_factory=ObservationConfig)
    strays: StrayConfig = field(default_factory=StrayConfig)
    min_points: int = 16
    half_width: float = 0.2
    grid: CoarseToFineConfig = field(default_factory=CoarseToFineConfig)
    largest_deviation: float = 0.05
    difference_step: float = 0.001


@dataclass(frozen=True)
class VPrismConfig:
    """The V-PRISM baseline (Wright et al. 2024, arXiv 2403.08106), as its authors ran it.

    `gamma` is of the kernel exp(-gamma |x - h|^2), 1 / m^2. Two values are not theirs:
    `feature_floor`, under which a feature counts as 0, and `half_width` of the box around an
    object's centre outside of which its occupancy is 0.
    """

    observation: ObservationConfig = field(default_factory=_vprism_observation)
    surface: SurfaceConfig = field(
        default_factory=lambda: SurfaceConfig(level=0.5, one_piece=False)
    )
    hinge_spacing: float = 0.05
    hinge_radius: float = 0.15
    surface_hinges: int = 32
    gamma: float = 1000.0
    feature_floor: float = 1e-7
    prior_variance: float = 1e4
    iterations: int = 3
    max_update_points: int = 20_000
    half_width: float = 0.2
    grid: CoarseToFineConfig = field(default_factory=CoarseToFineConfig)
