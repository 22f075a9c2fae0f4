"""Every constant of the method, in two presets.

`paper` holds the constants of the paper and of its authors' implementation; `default` is what
`brrp` uses when nothing else is asked for. The effective configuration is saved beside every
result. Lengths are metres.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from brrp_cli.config.baselines import CoarseToFineConfig, PointSDFConfig, VPrismConfig
from brrp_cli.config.inference import (
    CompletionConfig,
    FittedDepthConfig,
    FittedMapConfig,
    InferenceConfig,
    MeanConfig,
    RampConfig,
    RevolutionConfig,
    StandingConfig,
    VolumeConfig,
)
from brrp_cli.config.kin import KinConfig
from brrp_cli.config.observation import (
    FlatteningConfig,
    FloorConfig,
    MixedEdgesConfig,
    ObservationConfig,
    SensorConfig,
    StrayConfig,
)
from brrp_cli.config.registration import (
    FeatureConfig,
    LikelihoodConfig,
    RayRefinementConfig,
    RegistrationConfig,
    SearchConfig,
    VerificationConfig,
    WeighConfig,
)
from brrp_cli.config.retrieval import RetrievalConfig
from brrp_cli.config.seen_mask import SeenMaskConfig
from brrp_cli.config.surface import SurfaceConfig
from brrp_cli.config.turns import ColourConfig, TurnConfig
from brrp_cli.errors import BrrpError

__all__ = [
    "PRESETS",
    "CoarseToFineConfig",
    "ColourConfig",
    "CompletionConfig",
    "Config",
    "FeatureConfig",
    "FittedDepthConfig",
    "FittedMapConfig",
    "FlatteningConfig",
    "FloorConfig",
    "HypothesesConfig",
    "InferenceConfig",
    "KinConfig",
    "LikelihoodConfig",
    "MeanConfig",
    "MixedEdgesConfig",
    "ObservationConfig",
    "PointSDFConfig",
    "RampConfig",
    "RayRefinementConfig",
    "RegistrationConfig",
    "RetrievalConfig",
    "RevolutionConfig",
    "SearchConfig",
    "SeenMaskConfig",
    "SensorConfig",
    "StandingConfig",
    "StrayConfig",
    "SurfaceConfig",
    "TurnConfig",
    "VPrismConfig",
    "VerificationConfig",
    "VolumeConfig",
    "WeighConfig",
    "preset",
]


@dataclass(frozen=True)
class HypothesesConfig:
    """What takes the place of the scale scan and of the fixed grid of hinge points."""

    search: SearchConfig = field(default_factory=SearchConfig)
    mask: SeenMaskConfig = field(default_factory=SeenMaskConfig)
    refine: RayRefinementConfig = field(default_factory=RayRefinementConfig)
    likelihood: LikelihoodConfig = field(default_factory=LikelihoodConfig)
    weigh: WeighConfig = field(default_factory=WeighConfig)
    mean: MeanConfig = field(default_factory=MeanConfig)
    completion: CompletionConfig = field(default_factory=CompletionConfig)
    kin: KinConfig = field(default_factory=KinConfig)
    map: FittedMapConfig = field(default_factory=FittedMapConfig)
    sensor: SensorConfig = field(default_factory=SensorConfig)
    flattening: FlatteningConfig = field(default_factory=FlatteningConfig)
    mixed_edges: MixedEdgesConfig = field(default_factory=MixedEdgesConfig)


@dataclass(frozen=True)
class Config:
    """The whole method. `preset` names where the values came from.

    strays : what retrieval by appearance leaves out of each mask, and `hypotheses` too
    hypotheses : None is the paper's way, `registration` and `inference`, which mean nothing
    otherwise
    """

    preset: str = "default"
    k: int = 3
    strays: StrayConfig = field(default_factory=StrayConfig)
    features: FeatureConfig = field(default_factory=FeatureConfig)
    registration: RegistrationConfig = field(default_factory=RegistrationConfig)
    observation: ObservationConfig = field(default_factory=ObservationConfig)
    inference: InferenceConfig = field(default_factory=InferenceConfig)
    retrieval: RetrievalConfig = field(default_factory=RetrievalConfig)
    surface: SurfaceConfig = field(default_factory=SurfaceConfig)
    hypotheses: HypothesesConfig | None = field(default_factory=HypothesesConfig)

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON and HDF5."""
        return asdict(self)


PRESETS = {
    "default": Config(preset="default"),
    "paper": Config(
        preset="paper",
        observation=ObservationConfig(floor=None, support=None),
        surface=SurfaceConfig(level=0.5, one_piece=False),
        hypotheses=None,
    ),
}


def preset(name: str) -> Config:
    """The configuration of that name."""
    if name not in PRESETS:
        raise BrrpError("No such preset", found=name, expected=", ".join(PRESETS))
    return PRESETS[name]
