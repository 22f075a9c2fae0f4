"""What all objects of a frame have in common, for the default preset."""

from __future__ import annotations

from dataclasses import dataclass

from brrp_cli.config import Config
from brrp_cli.device import pick_device
from brrp_cli.frames.frame import Frame
from brrp_cli.methods.base import Setup
from brrp_cli.observation.flattened import raised, smoothing_width
from brrp_cli.observation.pixel_noise import PixelNoise, pixel_noise
from brrp_cli.observation.ray_samples import scene_plane
from brrp_cli.observation.sensor_noise import wave_deviation
from brrp_cli.observation.support_plane import Plane
from brrp_cli.prior.store import Prior
from brrp_cli.retrieval.base import Retriever, knows_depth


@dataclass(frozen=True)
class Image:
    """What an image shows whatever its masks are, all but.

    plane : what its objects stand on; wave : metres, standard deviation of the mean depth of a
    patch (observation/sensor_noise.py); noise : of its pixels; smoothing : pixels over which the
    camera mixes low things with the table (observation/flattened.py)
    """

    plane: Plane | None
    wave: float
    noise: PixelNoise
    smoothing: float


@dataclass(frozen=True)
class Scene:
    """frame : without strays, low things as high as they are; measured : the same as it was
    measured; image : its own, or that of the same frame with other masks; aligns : whether P(c|R)
    follows from depth, too"""

    frame: Frame
    measured: Frame
    image: Image
    prior: Prior
    config: Config
    aligns: bool
    seed: int
    device: str


def look_at(frame: Frame, setup: Setup, retriever: Retriever) -> Scene:
    """The scene of a frame."""
    config, prior = setup.config, setup.prior
    assert isinstance(config, Config) and config.hypotheses is not None and prior is not None
    sensor, flattening = config.hypotheses.sensor, config.hypotheses.flattening
    measured, image = frame, setup.image
    if image is None:
        plane = scene_plane(measured, config.observation, setup.seed)
        smoothing = smoothing_width(measured, plane, flattening)
        frame = raised(measured, plane, smoothing, flattening)
        wave = wave_deviation(frame, plane, sensor)
        image = Image(plane, wave, pixel_noise(frame, plane, sensor), smoothing)
    else:
        assert isinstance(image, Image)
        frame = raised(measured, image.plane, image.smoothing, flattening)
    return Scene(
        frame,
        measured,
        image,
        prior,
        config,
        knows_depth(retriever),
        setup.seed,
        pick_device(setup.device),
    )
