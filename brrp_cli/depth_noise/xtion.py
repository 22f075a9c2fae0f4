"""An Asus Xtion: structured light that matches blocks of a speckle pattern (PrimeSense).

The errors arise in disparity, in pixels of the infrared camera, so that they grow with depth
squared:

- the projector stands 75 mm to the left: what it does not light is missing, right of things;
- a block's match belongs to whatever dominates the block: silhouettes are ragged, too wide by a
  pixel or two, with a rim of missing pixels on the far side (Handa et al., ICRA 2014, and Barron &
  Malik, CVPR 2013, jitter single pixels; here neighbours move together, as blocks overlap);
- noise correlated over a block, and slow waves that calibration left (Khoshelham & Elberink,
  Sensors 2012, for disparity noise; Teichman, Miller & Thrun, "CLAMS", RSS 2013, for the waves);
- dark, glossy and grazing surfaces send back too few speckles and are missing (Nguyen, Izadi &
  Lovell, 3DIMPVT 2012, measured up to 70 degrees), highlights drown them;
- disparity in steps. The first Kinect has 1/8 of a pixel (Khoshelham & Elberink: 2.85 mm at 1 m);
  the Xtion frames of `docs/sensors.md` show none that coarse, so the step here is 1/16.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library
from brrp_cli.depth_noise.view import View
from brrp_cli.depth_noise.waves import waves

DEPTH_CAMERA = 0.025  # metres to the right of the colour camera
BASELINE = 0.075  # metres from the infrared camera to the projector on its left
SUBPIXEL = 16  # steps of disparity a pixel
NEAREST, FARTHEST = 0.4, 4.0  # metres
# Standard deviations of disparity, pixels, and the correlation's length, pixels.
SINGLE = 0.02
BLOCKS, BLOCK_LENGTH = 0.075, 3.0
WAVES, WAVE_LENGTH = 0.085, 40.0
# Silhouettes, pixels: raggedness and its length, how far the near side bleeds over, the rim.
RAGGED, RAGGED_LENGTH, BLEED, RIM = 1.5, 2.5, 1, 1
EDGE = 1.5  # pixels of disparity that are an edge
# Signal (`View.signal`) under which nothing is matched, and its spread between patches, in log.
FAINT, FAINT_SPREAD, FAINT_LENGTH = 0.06, 0.5, 2.0
DAZZLING = 0.25  # `View.highlight` that drowns the speckles


def xtion_depth(view: View, rng: np.random.Generator) -> NDArray[np.float64]:
    """Depth (H, W), metres, 0 = no return, in the infrared camera's own view."""
    ndimage = import_library("scipy.ndimage")
    scale = view.K[0, 0] * BASELINE
    clean = np.where(view.depth > 0, scale / np.where(view.depth > 0, view.depth, 1.0), 0.0)
    disparity = _ragged(clean, rng)
    near = ndimage.grey_dilation(disparity, size=2 * BLEED + 1)
    disparity = np.where(near - disparity > EDGE, near, disparity)
    rim = ndimage.grey_dilation(disparity, size=2 * RIM + 1) - disparity > EDGE
    missing = (disparity == 0) | rim | unlit(clean) | _unmatched(view, rng)
    noise = (
        SINGLE * rng.standard_normal(clean.shape)
        + BLOCKS * waves(clean.shape, BLOCK_LENGTH, rng)
        + WAVES * waves(clean.shape, WAVE_LENGTH, rng)
    )
    steps = np.rint((disparity + noise) * SUBPIXEL)
    depth = scale * SUBPIXEL / np.maximum(steps, 1)
    return np.where(missing | (depth < NEAREST) | (depth > FARTHEST), 0.0, depth)


def unlit(disparity: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(H, W) True where something nearer keeps the projector's light away.

    disparity : (H, W) pixels, 0 = nothing there. A pixel u lies in the projector's column
    u + disparity; the light reaches it unless a pixel further left lies in that column or beyond.
    """
    known = disparity > 0
    column = np.where(known, np.arange(disparity.shape[1]) + disparity, -np.inf)
    shadow = np.zeros(disparity.shape, dtype=bool)
    shadow[:, 1:] = np.maximum.accumulate(column, axis=1)[:, :-1] >= column[:, 1:] + 0.5
    return shadow & known


def _ragged(disparity: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    height, width = disparity.shape
    shift = [np.rint(RAGGED * waves(disparity.shape, RAGGED_LENGTH, rng)) for _ in range(2)]
    row = np.clip(np.arange(height)[:, None] + shift[0], 0, height - 1).astype(np.int64)
    column = np.clip(np.arange(width)[None, :] + shift[1], 0, width - 1).astype(np.int64)
    beside = disparity[row, column]
    # Raggedness belongs to edges; on smooth surfaces the noise is drawn on its own.
    return np.where(np.abs(beside - disparity) > EDGE, beside, disparity)


def _unmatched(view: View, rng: np.random.Generator) -> NDArray[np.bool_]:
    patches = np.exp(FAINT_SPREAD * waves(view.depth.shape, FAINT_LENGTH, rng))
    return (view.signal < FAINT * patches) | (view.highlight > DAZZLING * patches)
