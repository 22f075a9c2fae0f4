"""A placement refined by rays, as the default method does it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from brrp_cli.config import HypothesesConfig
from brrp_cli.registration.pose_search import Hypothesis
from brrp_cli.registration.ray_refinement import OtherRays, refine_by_rays
from brrp_cli.registration.verification import Verifier


def refined(
    hypothesis: Hypothesis,
    verifier: Verifier,
    wave: float,
    config: HypothesesConfig,
    others: Sequence[OtherRays] = (),
) -> Hypothesis:
    """The placement under which the rays of what was seen meet the stored mesh; its score stays.

    wave : metres (observation/sensor_noise.py); others : what other views measured
    """
    T_cam_object = refine_by_rays(
        hypothesis.T_cam_object,
        hypothesis.model.stored.shape,
        verifier.points,
        float(verifier.frame.K[0, 0]),
        verifier.plane,
        wave,
        config.sensor,
        config.refine,
        others,
        verifier.mask,
    )
    T_cam_model = T_cam_object @ np.linalg.inv(hypothesis.model.T_model_object)
    return replace(hypothesis, T_cam_model=T_cam_model)
