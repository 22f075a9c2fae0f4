"""An Azure Kinect: time of flight by the phase of modulated light.

A pixel sums all light that arrives in it as phasors, amplitude times exp(i phase), and reports the
phase of the sum. What goes wrong follows from the sum:

- at silhouettes light of near and far mixes: flying pixels in between; where the mix is too
  incoherent the camera drops the pixel;
- light bounces: concave corners look too deep (`multipath`);
- the lens scatters a little light of bright things over the image;
- noise goes with sqrt(light) / light (Lange & Seitz, IEEE J. Quantum Electronics 2001): dark and
  grazing surfaces are noisy, then missing; highlights saturate and are missing;
- the phase's error repeats with distance ("wiggling": Lindner & Kolb, ISVC 2006), and calibration
  leaves slow waves.

Figures are Bamji et al. (ISSCC 2018: 200 MHz and less, one megapixel), Microsoft's data sheet
(systematic error < 11 mm + 0.1 % of the distance) and Toelgyessy et al. (Sensors 2021: standard
deviation about 1 mm at 1 m). No frame of this camera was at hand to check them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library
from brrp_cli.depth_noise.multipath import bounced_light
from brrp_cli.depth_noise.view import View
from brrp_cli.depth_noise.waves import waves

DEPTH_CAMERA = -0.032  # metres: to the left of the colour camera
HALF_WAVE = 0.75  # metres of distance for one turn of the phase at 200 MHz
BLUR = 0.7  # pixels, standard deviation of the lens
SCATTER, SCATTER_WIDTH = 0.01, 15.0  # share of light that the lens scatters, and how far, pixels
COHERENT = 0.85  # length of the sum over the sum of lengths, below which a pixel is dropped
NOISE = 4e-4  # metres of standard deviation at signal 1
ROOM = 0.02  # signal that the room's light adds to the noise alone
SMOOTHED = 0.8  # pixels: the camera's own smoothing of noise
WIGGLE, WAVES, WAVE_LENGTH = 1.0e-3, 1.2e-3, 30.0  # metres, metres, pixels
FAINT, FAINT_SPREAD = 0.02, 0.25  # signal that is dropped, spread between pixels in log
DAZZLING = 0.6  # `View.highlight` that saturates
NEAREST, FARTHEST = 0.25, 3.9  # metres, narrow field of view


def kinect_azure_depth(view: View, rng: np.random.Generator) -> NDArray[np.float64]:
    """Depth (H, W), metres, 0 = no return, in the depth camera's own view."""
    distance = view.depth * view.stretch
    direct = view.signal + view.highlight
    turn = np.exp(2j * np.pi * distance / HALF_WAVE)
    light = direct * turn + bounced_light(view, HALF_WAVE)
    mixed, amount = _through_the_lens(light), _through_the_lens(np.abs(light))
    seen = view.depth > 0
    # Which turn of the phase is right the camera learns from its lower frequencies.
    error = np.angle(mixed * np.conj(turn)) / (2 * np.pi) * HALF_WAVE
    strength = np.maximum(np.abs(mixed), 1e-6)
    error += NOISE * np.sqrt(strength + ROOM) / strength * _noise(distance.shape, rng)
    error += WIGGLE * np.sin(8 * np.pi * distance / HALF_WAVE + rng.uniform(0, 2 * np.pi))
    error += WAVES * waves(distance.shape, WAVE_LENGTH, rng)
    faint = strength < FAINT * np.exp(FAINT_SPREAD * rng.standard_normal(distance.shape))
    incoherent = strength < COHERENT * amount
    depth = (distance + error) / view.stretch
    missing = ~seen | faint | incoherent | (view.highlight > DAZZLING)
    return np.where(missing | (depth < NEAREST) | (depth > FARTHEST), 0.0, depth)


def _through_the_lens(light: NDArray[np.complexfloating]) -> NDArray[np.complex128]:
    ndimage = import_library("scipy.ndimage")
    sharp = ndimage.gaussian_filter(light, BLUR)
    return np.asarray(
        (1 - SCATTER) * sharp + SCATTER * ndimage.gaussian_filter(light, SCATTER_WIDTH)
    )


def _noise(shape: tuple[int, int], rng: np.random.Generator) -> NDArray[np.float64]:
    return waves(shape, SMOOTHED, rng)
