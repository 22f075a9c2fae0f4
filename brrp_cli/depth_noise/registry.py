"""Depth cameras by name that need no more than their own view."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.depth_noise import kinect_azure, xtion
from brrp_cli.depth_noise.view import View


@dataclass(frozen=True)
class ViewSensor:
    """A camera whose errors are a function of its own view.

    depth_camera : metres by which its depth camera stands to the right of its colour camera
    measure : from that view, depth (H, W) in metres, 0 = no return
    """

    depth_camera: float
    measure: Callable[[View, np.random.Generator], NDArray[np.float64]]


VIEW_SENSORS = {
    "xtion": ViewSensor(xtion.DEPTH_CAMERA, xtion.xtion_depth),
    "kinect-azure": ViewSensor(kinect_azure.DEPTH_CAMERA, kinect_azure.kinect_azure_depth),
}
