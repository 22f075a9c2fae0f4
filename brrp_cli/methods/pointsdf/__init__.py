"""PointSDF, the learned baseline: a network from a seen cloud to occupancy."""

from __future__ import annotations

from typing import TYPE_CHECKING

from brrp_cli.config import PointSDFConfig
from brrp_cli.methods.base import Method, Setup
from brrp_cli.methods.pointsdf.weights import OWN_WEIGHTS, describe_weights

if TYPE_CHECKING:
    from brrp_cli.frames.frame import Frame
    from brrp_cli.reconstruction import Reconstruction, StoredPosterior


def _run(frame: Frame, setup: Setup) -> Reconstruction:
    from brrp_cli.methods.pointsdf.method import run

    return run(frame, setup)


def _posteriors() -> tuple[type[StoredPosterior], ...]:
    from brrp_cli.methods.pointsdf.method import PointSDFPosterior

    return (PointSDFPosterior,)


METHOD = Method(
    name="pointsdf",
    summary="a trained network",
    presets={"default": PointSDFConfig()},
    run=_run,
    posteriors=_posteriors,
    describe_weights=describe_weights,
    own_weights=OWN_WEIGHTS,
    uses_cuda=True,
)
