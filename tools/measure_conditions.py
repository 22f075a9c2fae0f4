"""What becomes of a frame's masks, and of what is recognised in it, if the camera were another one?

    python tools/measure_conditions.py FRAMES... [--prior PRIOR] [--only half,grey,...]

Every frame (anything that `brrp frame` reads) is changed in each of CONDITIONS: depth with holes,
coarse, noisy, filled or moved against colour; colours in other light, grey, blurred or compressed;
images of other sizes, on their side, rolled. Its own masks are not looked at. Counted are

same        masks from depth of the frame as it is that one of the changed frame matches, IoU over
            0.75
made        masks of the changed frame
recognised  with a prior: stored objects that are recognised in the frame as it is, and still are
others      and those that are recognised in the changed frame alone

Frames that are changed are not the truth of another camera: they show what a change does, and
nothing else.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message

from brrp_cli.errors import FrameError
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.frames.readers import read_frame
from brrp_cli.seeds import child_rng
from brrp_cli.segmentation.segment import segment
from brrp_cli.segmentation.upright import turned, turned_back
from brrp_cli.session import Reconstructor

Depth = NDArray[np.float64]
Masks = NDArray[np.int64]
Change = Callable[[Depth], Depth]

MATCHES = 0.75


@dataclass(frozen=True)
class Condition:
    """made : the frame as another camera might have it; back : masks of that, at the pixels of the
    frame as it is"""

    made: Callable[[Frame], Frame]
    back: Callable[[Masks], Masks] = lambda masks: masks


def with_depth(change: Change) -> Condition:
    """Depth (H, W), metres, 0 = no return, changed."""

    def made(frame: Frame) -> Frame:
        depth = change(np.where(frame.valid, frame.depth, 0).astype(np.float64))
        return make_frame(rgb=frame.rgb, depth=depth, K=frame.K)

    return Condition(made)


def kept_where(pattern: Callable[[tuple[int, ...]], NDArray[np.bool_]]) -> Condition:
    """Depth at some of the pixels (H, W)."""
    return with_depth(lambda depth: np.where(pattern(depth.shape), depth, 0))


def with_colour(change: Callable[[NDArray[np.uint8]], NDArray[np.uint8]]) -> Condition:
    """Colours (H, W, 3), changed."""

    def made(frame: Frame) -> Frame:
        depth = np.where(frame.valid, frame.depth, 0)
        return make_frame(rgb=change(frame.rgb), depth=depth, K=frame.K)

    return Condition(made)


def lying(turns: int) -> Condition:
    """A camera that was turned about its line of sight by quarter turns."""
    return Condition(
        lambda frame: turned(frame, turns).without_masks(), lambda masks: turned_back(masks, turns)
    )


def rolled(degrees: float) -> Condition:
    """A camera that was turned about its line of sight, clockwise; what leaves the image is lost.
    Focal lengths along rows and columns are taken to be one."""

    def made(frame: Frame) -> Frame:
        rgb = rotated(frame.rgb, degrees, order=1)
        depth = rotated(np.where(frame.valid, frame.depth, 0), degrees, order=0)
        K, middle = frame.K.copy(), (np.array(frame.shape[::-1]) - 1) / 2
        angle = np.radians(degrees)
        across, along = np.cos(angle), np.sin(angle)
        K[:2, 2] = [[across, along], [-along, across]] @ (K[:2, 2] - middle) + middle
        return make_frame(rgb=rgb.round().astype(np.uint8), depth=depth, K=K)

    return Condition(made, lambda masks: rotated(masks, -degrees, order=0).astype(masks.dtype))


def rotated(image: NDArray[Any], degrees: float, order: int) -> NDArray[np.float64]:
    """(H, W, ...), counter-clockwise about its middle; 0 where nothing was."""
    from skimage.transform import rotate

    floats = image.astype(np.float64)
    return np.asarray(rotate(floats, degrees, order=order, preserve_range=True))


def resized(factor: float) -> Condition:
    """An image of `factor` times the size: 0.5 or a whole number."""

    def made(frame: Frame) -> Frame:
        from skimage.transform import resize

        shape = tuple(round(factor * size) for size in frame.shape)
        rgb = resize(frame.rgb, shape, anti_aliasing=factor < 1, preserve_range=True)
        depth = nearest(np.where(frame.valid, frame.depth, 0), factor)
        K = frame.K.copy()
        # The middle of the image's first pixel is at 0.
        K[:2, 2] = (K[:2, 2] + 0.5) * factor - 0.5
        K[:2, :2] *= factor
        return make_frame(rgb=rgb.round().astype(np.uint8), depth=depth, K=K)

    return Condition(made, lambda masks: nearest(masks, 1 / factor))


def nearest(image: NDArray[np.generic], factor: float) -> NDArray[np.generic]:
    """(H, W) in `factor` times the size."""
    if factor < 1:
        step = round(1 / factor)
        return image[::step, ::step]
    return image.repeat(round(factor), axis=0).repeat(round(factor), axis=1)


def draw(name: str) -> np.random.Generator:
    """Its own, for each condition."""
    return child_rng(0, "conditions", name)


def every(step: int, axes: tuple[int, ...]) -> Callable[[tuple[int, ...]], NDArray[np.bool_]]:
    """One row, or pixel, of so many (H, W)."""
    return lambda shape: np.logical_and.reduce([np.indices(shape)[a] % step == 0 for a in axes])


def noisy(depth: Depth) -> Depth:
    """With noise of 6 mm, standard deviation."""
    return np.where(depth > 0, depth + draw("noise").normal(0, 0.006, depth.shape), 0)


def coarse(depth: Depth) -> Depth:
    """Of a quarter of the size, and as large as before."""
    height, width = depth.shape
    found = np.zeros_like(depth)
    blocks = nearest(depth[2::4, 2::4], 4)[:height, :width]
    found[: blocks.shape[0], : blocks.shape[1]] = blocks
    return found


def interpolated(depth: Depth) -> Depth:
    """Of half the size, enlarged linearly: edges lie between what they divide."""
    from skimage.transform import resize

    return np.asarray(resize(depth[::2, ::2], depth.shape, order=1, preserve_range=True))


def filled(depth: Depth) -> Depth:
    """With what is on the left of a hole in it, as some cameras' filters fill them. What lies on
    the image's left border stays."""
    column = np.where(depth > 0, np.arange(depth.shape[1]), 0)
    return np.take_along_axis(depth, np.maximum.accumulate(column, axis=1), axis=1)


def filled_from(choice: Callable[[list[float]], float]) -> Change:
    """With the farthest or the nearest depth on the left of a hole's pixel, above and below it, as
    librealsense's filter fills them: row by row, with what was filled before."""

    def change(depth: Depth) -> Depth:
        whole = depth.copy()
        for v, u in np.argwhere(depth[1:-1, 1:] == 0) + 1:
            left, above = whole[v - 1 : v + 2, u - 1], whole[v - 1 : v + 2 : 2, u]
            whole[v, u] = choice([float(z) for z in (*left, *above) if z > 0] or [0.0])
        return whole

    return change


def without_edges(depth: Depth) -> Depth:
    """Without what is four pixels or less from a jump of 2 cm."""
    from scipy.ndimage import maximum_filter, minimum_filter

    behind, before = maximum_filter(depth, 9), minimum_filter(np.where(depth > 0, depth, np.inf), 9)
    return np.where(behind - before > 0.02, 0, depth)


def grey(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Colours (H, W, 3) without hue."""
    return rgb.mean(axis=-1, keepdims=True).repeat(3, axis=-1).astype(np.uint8)


def lit(*gains: float) -> Condition:
    """Red, green and blue so many times as bright, 255 at most."""
    return with_colour(lambda rgb: np.minimum(rgb * np.array(gains), 255).astype(np.uint8))


def blurred(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Colours (H, W, 3) of a camera that moved sideways by nine pixels."""
    from scipy.ndimage import uniform_filter1d

    return uniform_filter1d(rgb.astype(np.float64), 9, axis=1).round().astype(np.uint8)


def compressed(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Colours (H, W, 3) after JPEG of quality 50."""
    file = BytesIO()
    Image.fromarray(rgb).save(file, "JPEG", quality=50)
    return np.asarray(Image.open(file))


CONDITIONS = {
    "third_rows": kept_where(every(3, (0,))),
    "quarter": kept_where(every(2, (0, 1))),
    "dropped_30": kept_where(lambda shape: draw("30").random(shape) >= 0.3),
    "dropped_60": kept_where(lambda shape: draw("60").random(shape) >= 0.6),
    "coarse": with_depth(coarse),
    "steps_8_mm": with_depth(lambda depth: np.round(depth / 0.008) * 0.008),
    "noise_6_mm": with_depth(noisy),
    "no_edges": with_depth(without_edges),
    "interpolated": with_depth(interpolated),
    "filled": with_depth(filled),
    "filled_far": with_depth(filled_from(max)),
    "filled_near": with_depth(filled_from(min)),
    "moved": with_colour(lambda rgb: np.roll(rgb, (2, 4), (0, 1))),
    "grey": with_colour(grey),
    "dark": with_colour(lambda rgb: (255 * (rgb / 255) ** 1.6).astype(np.uint8)),
    "bright": lit(1.8, 1.8, 1.8),
    "warm": lit(1.2, 1.0, 0.7),
    "cool": lit(0.75, 1.0, 1.25),
    "blurred": with_colour(blurred),
    "jpeg_50": with_colour(compressed),
    "half": resized(0.5),
    "double": resized(2),
    "on_its_side": lying(1),
    "upside_down": lying(2),
    "rolled_20": rolled(20),
    "rolled_45": rolled(45),
}


@dataclass
class Counts:
    """Of one condition, over all frames."""

    same: int = 0
    masks: int = 0
    made: int = 0
    still: int = 0
    recognised: int = 0
    others: int = 0


def matched(masks: Masks, others: Masks) -> int:
    """How many masks (H, W) one of the others (H, W) matches."""
    count = 0
    for number in np.unique(masks[masks != BACKGROUND]):
        mine = masks == number
        overlaps = [
            (mine & theirs).sum() / (mine | theirs).sum()
            for theirs in (others == i for i in np.unique(others[mine]) if i != BACKGROUND)
        ]
        count += bool(overlaps) and max(overlaps) > MATCHES
    return count


def masks_of(frame: Frame) -> Masks:
    """Masks from depth; none where nothing is found."""
    try:
        return segment(frame)
    except FrameError:
        return np.zeros(frame.shape, np.int64)


def recognised_in(frame: Frame, reconstruct: Reconstructor | None) -> set[str]:
    """Names of the stored objects that are recognised; none without a prior."""
    if reconstruct is None:
        return set()
    try:
        found = reconstruct(frame).objects
    except FrameError:
        return set()
    return {each.recognised.name for each in found if each.recognised is not None}


def add(counts: dict[str, Counts], frame: Frame, reconstruct: Reconstructor | None) -> None:
    """One frame in every condition of `counts`."""
    frame = frame.without_masks()
    masks, names = masks_of(frame), recognised_in(frame, reconstruct)
    for name, count in counts.items():
        changed = CONDITIONS[name].made(frame)
        found = CONDITIONS[name].back(masks_of(changed))
        theirs = recognised_in(changed, reconstruct)
        count.same += matched(masks, found)
        count.masks += len(np.unique(masks[masks != BACKGROUND]))
        count.made += len(np.unique(found[found != BACKGROUND]))
        count.still += len(names & theirs)
        count.recognised += len(names)
        count.others += len(theirs - names)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("frames", type=Path, nargs="+")
    parser.add_argument("--prior", type=Path)
    parser.add_argument("--only", default=",".join(CONDITIONS))
    args = parser.parse_args()
    unknown = set(args.only.split(",")) - set(CONDITIONS)
    if unknown:
        parser.error(
            f"--only takes some of {','.join(CONDITIONS)}, not {','.join(sorted(unknown))}"
        )
    counts = {name: Counts() for name in args.only.split(",")}
    reconstruct = None if args.prior is None else Reconstructor(args.prior)
    for path in args.frames:
        add(counts, read_frame(path), reconstruct)
    print("| | same masks | masks made | recognised | others |\n| --- | --- | --- | --- | --- |")
    for name, found in counts.items():
        recognised = (
            f"{found.still} of {found.recognised} | {found.others}" if args.prior else "- | -"
        )
        print(f"| {name} | {found.same} of {found.masks} | {found.made} | {recognised} |")


if __name__ == "__main__":
    with one_message():
        main()
