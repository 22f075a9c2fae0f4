"""Depth cameras by name: what each reports of a stage, in its colour camera's view."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from brrp_cli.depth_noise.align import align_depth
from brrp_cli.depth_noise.millimetres import whole_millimetres
from brrp_cli.depth_noise.registry import VIEW_SENSORS, ViewSensor
from tabletop.stage import Stage
from tabletop.stereo_matching import stereo_depth

# From a stage and random numbers to depth (H, W), metres, whole millimetres, 0 = no return.
Sensor = Callable[[Stage, np.random.Generator], NDArray[np.float64]]


def _measure(sensor: ViewSensor, stage: Stage, rng: np.random.Generator) -> NDArray[np.float64]:
    measured = sensor.measure(stage.view(sensor.depth_camera), rng)
    aligned = align_depth(measured, stage.K, sensor.depth_camera, stage.K, stage.shape)
    return whole_millimetres(aligned)


SENSORS: dict[str, Sensor] = {
    "stereo": stereo_depth,
    **{name: partial(_measure, sensor) for name, sensor in VIEW_SENSORS.items()},
}
