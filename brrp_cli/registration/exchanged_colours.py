"""Whether red and blue of an image are exchanged, as OpenCV reads images: stored objects that lie
in the frame tell, since what is reddest of their print is then bluest in the image."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import depth_behind, pixel_numbers
from brrp_cli.geometry import transform_points
from brrp_cli.prior.objects import PriorObject
from brrp_cli.prior.store import Prior
from brrp_cli.reconstruction import Reconstruction, Retrieved

log = logging.getLogger(__name__)

Array = NDArray[np.float64]

VERTICES, LEAST = 2000, 40  # of an object that are asked, and that have to be seen
NEAR = 0.01  # metres between a vertex and the measured depth
ALIGNED = 0.6  # alignment score from which on an object may be the one that lies there
SURE = 0.9  # weight from which on it is that one
COLOURED = 0.05  # deviation of `_red_against_blue` under which there is nothing to compare
# Correlation times the root of the number of objects. Where there were colours to compare, it was
# -0.44 or more in some 100 real and made frames, but for one where what is `SURE` spoke against it,
# and -0.5 or less in most of those that show stored objects once their channels were exchanged. It
# decides on a warning, not on any result.
EXCHANGED = -0.45
_DARK = 30.0  # of 3 * 255, added to a sum of channels, so that black has no hue


class ColourCheck:
    """Warns, once, of images that seem to be BGR, going by what was found in them."""

    def __init__(self, prior: Prior | None) -> None:
        self._prior = prior
        self._told = False

    def __call__(self, result: Reconstruction) -> None:
        """Look at one more result."""
        if self._told or self._prior is None:
            return
        placed = (best_aligned(item.retrieved) for item in result.objects)
        found = [(each, self._prior.load(each.name)) for each in placed if each is not None]
        if colours_exchanged(found, result.frame):
            self._told = True
            log.warning(
                "Red and blue of the image seem to be exchanged, going by the stored objects that "
                "fit in it: brrp expects RGB, and OpenCV reads BGR (rgb = bgr[..., ::-1])"
            )


def colours_exchanged(found: Iterable[tuple[Retrieved, PriorObject]], frame: Frame) -> bool:
    """Whether the image's red follows the stored objects' blue. found : of each seen object the
    stored one that lies best there, and that object."""
    if frame.hueless:
        return False
    pairs, sure = [], []
    for placed, stored in found:
        if not stored.record.get("coloured"):
            continue
        pair = _seen_print(placed, stored, frame)
        if pair.size:
            pairs.append(pair)
            if (placed.weight or 0.0) >= SURE:
                sure.append(pair)
    # What is recognised lies there; what fits best may be something else, of any colour.
    if _correlation(sure) > 0:
        return False
    return bool(_correlation(pairs) * np.sqrt(len(pairs)) <= EXCHANGED)


def _correlation(pairs: Sequence[Array]) -> float:
    """Of red against blue as stored and in the image, (2, n) each; 0 where there is nothing to
    compare."""
    if not pairs:
        return 0.0
    stored, image = np.concatenate(pairs, axis=1)
    squares = (stored**2).sum(), (image**2).sum()
    if min(squares) < COLOURED**2 * len(stored):
        return 0.0
    return float((stored * image).sum() / np.sqrt(squares[0] * squares[1]))


def best_aligned(retrieved: Iterable[Retrieved]) -> Retrieved | None:
    """Of the stored objects that were tried in one place the one that lies best, if well."""
    placed = [each for each in retrieved if (each.alignment_score or 0.0) >= ALIGNED]
    return max(placed, key=lambda each: each.alignment_score or 0.0, default=None)


def _seen_print(placed: Retrieved, stored: PriorObject, frame: Frame) -> Array:
    """(2, n) red against blue of the vertices that the camera sees, as stored and in the image,
    each about its mean; n = 0 where too few are seen."""
    assert placed.T_cam_object is not None
    T, shape = placed.T_cam_object, stored.shape
    rows = np.linspace(0, len(shape.vertices) - 1, VERTICES).astype(np.int64)
    points = transform_points(T, shape.vertices[rows].astype(np.float64))
    facing = (points * (shape.normals[rows] @ T[:3, :3].T)).sum(axis=1) < 0
    seen = facing & (np.abs(depth_behind(points, frame)) <= NEAR)
    if seen.sum() < LEAST:
        return np.empty((2, 0))
    pixels, _ = pixel_numbers(points[seen], frame)
    both = np.stack(
        [
            _red_against_blue(shape.colours[rows][seen]),
            _red_against_blue(frame.rgb.reshape(-1, 3)[pixels]),
        ]
    )
    return np.asarray(both - both.mean(axis=1, keepdims=True))


def _red_against_blue(colours: NDArray[np.uint8]) -> Array:
    """(n,) -1 to 1 of colours (n, 3)."""
    red, green, blue = colours.astype(np.float64).T
    return np.asarray((red - blue) / (red + green + blue + _DARK))
