"""V-PRISM, the baseline: one probabilistic multi-class map of the whole scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

from brrp_cli.config import VPrismConfig
from brrp_cli.methods.base import Method, Setup

if TYPE_CHECKING:
    from brrp_cli.frames.frame import Frame
    from brrp_cli.reconstruction import Reconstruction, StoredPosterior


def _run(frame: Frame, setup: Setup) -> Reconstruction:
    from brrp_cli.methods.vprism.method import run

    return run(frame, setup)


def _posteriors() -> tuple[type[StoredPosterior], ...]:
    from brrp_cli.methods.vprism.method import VPrismPosterior

    return (VPrismPosterior,)


METHOD = Method(
    name="vprism",
    summary="one map of the whole frame",
    presets={"default": VPrismConfig()},
    run=_run,
    posteriors=_posteriors,
)
