"""What all objects of a frame have in common, for the default preset."""

from __future__ import annotations

from dataclasses import dataclass

from brrp_cli.config import Config, HypothesesConfig, ObservationConfig
from brrp_cli.device import pick_device
from brrp_cli.frames.frame import Frame
from brrp_cli.methods.base import Setup
from brrp_cli.observation.flattened import low_things, raised, smoothing_width
from brrp_cli.observation.mixed_edges import mixing_width, without_mixed
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
    camera mixes low things with the table (observation/flattened.py); mixing : pixels over which it
    mixes both sides of a jump (observation/mixed_edges.py)
    """

    plane: Plane | None
    wave: float
    noise: PixelNoise
    smoothing: float
    mixing: int

    def mended(self, frame: Frame, config: HypothesesConfig, only: int | None = None) -> Frame:
        """A frame of this image with low things as high as they are; only : the one of which."""
        return raised(frame, self.plane, self.smoothing, config.flattening, only)

    def clear(self, mended: Frame, config: HypothesesConfig) -> Frame:
        """The same without depth that is mixed at outlines; where low things are raised, not of
        them."""
        low = low_things(mended, self.plane, config.flattening) if self.smoothing else []
        high = [i for i in mended.object_ids if i not in low]
        return without_mixed(mended, self.mixing, config.mixed_edges, high)


@dataclass(frozen=True)
class SeenScene:
    """measured : the frame without strays; frame : the same with low things as high as they are;
    clear : the same without what is mixed at outlines, of which completion makes shapes (stored
    ones are held against the outline, too); image : its own, or that of the same frame with other
    masks; aligns : whether P(c|R) follows from depth, too; given : as in `Setup`"""

    measured: Frame
    frame: Frame
    clear: Frame
    image: Image
    prior: Prior
    config: Config
    aligns: bool
    seed: int
    device: str
    given: frozenset[int] | None


def look_at(frame: Frame, setup: Setup, retriever: Retriever, shapes: bool = True) -> SeenScene:
    """The scene of a frame. shapes : whether shapes are to be made of what it shows"""
    config, prior = setup.config, setup.prior
    assert isinstance(config, Config) and config.hypotheses is not None and prior is not None
    hypotheses, measured, image = config.hypotheses, frame, setup.image
    if image is None:
        image = image_of(measured, hypotheses, config.observation, setup.seed)
    assert isinstance(image, Image)
    frame = image.mended(measured, hypotheses)
    return SeenScene(
        measured,
        frame,
        image.clear(frame, hypotheses) if shapes else frame,
        image,
        prior,
        config,
        knows_depth(retriever),
        setup.seed,
        pick_device(setup.device),
        setup.given,
    )


def image_of(
    measured: Frame, hypotheses: HypothesesConfig, observation: ObservationConfig, seed: int
) -> Image:
    """What a frame without strays shows."""
    sensor = hypotheses.sensor
    plane = scene_plane(measured, observation, seed)
    smoothing = smoothing_width(measured, plane, hypotheses.flattening)
    frame = raised(measured, plane, smoothing, hypotheses.flattening)
    return Image(
        plane,
        wave_deviation(frame, plane, sensor),
        pixel_noise(frame, plane, sensor),
        smoothing,
        mixing_width(measured, hypotheses.mixed_edges),
    )
