"""How far the depth of each pixel errs, measured in the frame itself.

Two parts. `fine` is each pixel's own: it is read off second differences along rows and columns, of
which a smooth surface has none, however it leans. `wave` is what the pixels of a patch have in
common: waves of the sensor and steps of its disparity, read off the support plane, which is flat.
Waves are wider than patches, so that patches are not as many independent votes:
`patches_per_vote` counts how many of them make one, by the autocorrelation of the table's patches.
What is smooth over `wave_window` is left out of both, for a placement that was fitted to the points
has taken it along.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SensorConfig
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.geometry import bounds, lengths
from brrp_cli.observation.sensor_noise import MEDIAN_ABSOLUTE, depth_deviation
from brrp_cli.observation.support_plane import Plane, plane_frame

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PixelNoise:
    """fine : (H, W) metres, standard deviation of what each pixel errs by itself; at_jump : (H, W)
    bool, so near to a jump of depth that sensors mix both sides; wave : metres, standard deviation
    of the mean depth of a patch, at `depth` metres; patches_per_vote : 1 at least"""

    fine: NDArray[np.float32]
    at_jump: NDArray[np.bool_]
    wave: float
    depth: float
    patches_per_vote: float

    def wave_at(self, depth: float) -> float:
        """Metres, of a patch `depth` metres away: errors of disparity grow with its square."""
        return self.wave * (depth / self.depth) ** 2


def pixel_noise(frame: Frame, plane: Plane | None, config: SensorConfig) -> PixelNoise:
    """The noise of a frame; of the table's patches where there are `config.least_patches`."""
    depth = np.where(frame.valid, frame.points[..., 2], np.nan).astype(np.float64)
    fine = _second_differences(depth, config)
    unknown = ~np.isfinite(fine)
    fine[unknown] = depth_deviation(np.nan_to_num(depth[unknown], nan=1.0), config)
    found = None if plane is None else _table_waves(frame, plane, config)
    wave, at, patches = found or (config.untold_wave, 1.0, config.patches_per_vote)
    return PixelNoise(fine.astype(np.float32), _at_jumps(depth, frame.K, config), wave, at, patches)


def _second_differences(depth: Array, config: SensorConfig) -> Array:
    """Standard deviation (H, W) of independent noise: the mean of (a - 2 b + c)^2 / 6 over
    `config.fine_window` pixels, along rows or columns, whichever is less; NaN where no depth is."""
    from scipy.ndimage import uniform_filter

    found = []
    for image in (depth, depth.T):
        square = np.full(image.shape, np.nan)
        square[1:-1] = (image[2:] - 2 * image[1:-1] + image[:-2]) ** 2 / 6
        good = square < config.jump**2
        count = uniform_filter(good.astype(np.float64), config.fine_window)
        total = uniform_filter(np.where(good, square, 0.0), config.fine_window)
        mean = np.where(count > 0.2, np.maximum(total, 0) / np.maximum(count, 0.2), np.nan)
        found.append(np.sqrt(mean))
    return np.asarray(np.fmin(found[0], found[1].T))


def _at_jumps(depth: Array, K: NDArray[np.floating], config: SensorConfig) -> NDArray[np.bool_]:
    """(H, W) within `config.bleed` radians of where depth jumps by more than `config.jump`."""
    from scipy.ndimage import binary_dilation

    farthest = _of_neighbours(np.nan_to_num(depth, nan=-np.inf), np.maximum)
    nearest = _of_neighbours(np.nan_to_num(depth, nan=np.inf), np.minimum)
    with np.errstate(invalid="ignore"):
        jump = np.isfinite(farthest) & (farthest - nearest > config.jump)
    return np.asarray(binary_dilation(jump, iterations=max(1, round(config.bleed * K[0, 0]) - 1)))


def _of_neighbours(image: Array, of: np.ufunc) -> Array:
    """The greatest or the least (H, W) of each pixel of an image (H, W) and the eight around it."""
    for _ in range(2):
        found = image.copy()
        of(found[1:], image[:-1], out=found[1:])
        of(found[:-1], image[1:], out=found[:-1])
        image = found.T
    return image


def _table_waves(
    frame: Frame, plane: Plane, config: SensorConfig
) -> tuple[float, float, float] | None:
    """Standard deviation of patches' mean depth, metres, the table's depth, metres, and patches in
    a vote; None where too little of the table is seen."""
    from scipy.ndimage import binary_erosion, uniform_filter

    height = plane.signed_distance(frame.points)
    with np.errstate(invalid="ignore"):
        table = (frame.segmap == BACKGROUND) & (np.abs(height) < config.table_reach)
    # Feet of objects and the table's edge are no waves.
    table = binary_erosion(table, iterations=max(1, round(config.table_margin * frame.K[0, 0])))
    points, height = frame.points[table].astype(np.float64), height[table]
    along = np.abs(points @ plane.normal / lengths(points))
    cells = np.floor(points @ plane_frame(plane)[:2, :3].T / config.patch).astype(np.int64)
    if len(cells) < config.patch_points:
        return None
    first, last = bounds(cells)
    cells -= first
    side = last - first + 1
    number = cells[:, 0] * side[1] + cells[:, 1]
    count = np.bincount(number, minlength=side.prod()).reshape(side)
    total = np.bincount(number, height / np.maximum(along, 0.1), side.prod()).reshape(side)
    whole = (count >= config.patch_points).astype(np.float64)
    if whole.sum() < config.least_patches:
        return None
    mean = np.where(whole > 0, total / np.maximum(count, 1), 0.0)
    window = 2 * round(config.wave_window / config.patch / 2) + 1
    share = uniform_filter(whole, window, mode="constant")
    smooth = uniform_filter(mean, window, mode="constant") / np.maximum(share, 1e-9)
    rest = np.where(whole > 0, mean - smooth, 0.0)
    wave = float(np.median(np.abs(rest[whole > 0])) / MEDIAN_ABSOLUTE)
    patches = _correlated(np.clip(rest, -3 * wave, 3 * wave), whole, window // 2, config)
    return max(wave, config.wave), float(np.median(points[:, 2])), patches


def _correlated(rest: Array, whole: Array, reach: int, config: SensorConfig) -> float:
    """How many patches of a map (n, m) err as one: the sum of its autocorrelation over shifts of
    up to `reach` patches, where it is over `config.least_correlation`. `whole` (n, m) is 1 where
    the map has a value."""
    products, pairs = _shifted_products(rest), _shifted_products(whole)
    middle = tuple(slice(max(n - 1 - reach, 0), n + reach) for n in rest.shape)
    products, pairs = products[middle], pairs[middle]
    covariance = np.where(pairs > config.patch_points, products / np.maximum(pairs, 1), 0.0)
    if covariance.max() <= 0:
        return 1.0
    correlation = covariance / covariance.max()
    return float(max(1.0, correlation[correlation > config.least_correlation].sum()))


def _shifted_products(values: Array) -> Array:
    """(2n - 1, 2m - 1) sums of products of a map (n, m) with itself, for each shift of one over the
    other, by Fourier transforms. `scipy.signal` has a function for it, and takes a second to
    import."""
    from scipy.fft import irfftn, next_fast_len, rfftn

    whole = [2 * n - 1 for n in values.shape]
    fast = [next_fast_len(n, real=True) for n in whole]
    found = irfftn(rfftn(values, fast) * rfftn(values[::-1, ::-1], fast), fast)
    return np.asarray(found[: whole[0], : whole[1]])
