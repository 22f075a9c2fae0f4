"""Batches of images for the network that parts objects, varied as real ones vary."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, uniform_filter
from torch import Tensor
from torch.nn.functional import avg_pool2d, interpolate

from brrp_cli.segmentation.image_channels import CHANNELS, COLOURS, NORMALS, SIDEWAYS
from training.mask_examples import Examples

# Channels and labels.
Batch = tuple[Tensor, Tensor]

# Times that images are drawn larger or smaller.
ZOOM = (0.6, 1.5)
# How often an image is turned about the line of sight, as that of a camera at a wrist.
TURNED = 0.35
# How often: depth has holes, colours are greys, all one, blurred, light falls in spots, or from one
# side.
HOLES, GREY, BLANK, BLURRED, SPOTS, ONE_SIDE = 0.4, 0.1, 0.08, 0.3, 0.4, 0.4
# How often an image has other colours on it, and then each object and the table; how often these
# are a print of several colours, and how many.
REPAINTED, EACH, TABLE, PRINTED, INKS = 0.7, 0.4, 0.7, 0.7, 4
MOST_HOLES = 12
# Of brightness in each channel (log), of gamma (log), of noise, 0 to 1.
BRIGHTNESS, TINT, GAMMA, NOISE = 0.35, 0.12, 0.3, 0.06
# Pixels over which colours are blurred.
BLURS = (3, 3, 5, 7)
# Sides of what is cut out of the depth, and sizes of what is printed, in pixels.
LARGEST_HOLE, PRINTS = 48, (6, 100)


def draw_batch(
    examples: Examples, rows: NDArray[np.int64], size: tuple[int, int], rng: np.random.Generator
) -> Batch:
    """Channels (B, CHANNELS, *size) and labels (B, *size) of these examples: a window of each."""
    found = [_window(examples, int(row), size, rng) for row in rows]
    channels = np.stack([each[0] for each in found]).astype(np.float32) / np.float32(63)
    labels = np.stack([each[1] for each in found])
    for one, label in zip(channels, labels, strict=True):
        one[COLOURS] = _other_colours(one[COLOURS], one[NORMALS], label, rng)
        if rng.random() < HOLES:
            _cut_holes(one, rng)
    return torch.from_numpy(channels), torch.from_numpy(labels.astype(np.int64))


def _window(
    examples: Examples, row: int, size: tuple[int, int], rng: np.random.Generator
) -> tuple[NDArray[np.int8], NDArray[np.uint8]]:
    """A window of one example, larger or smaller, mirrored every other time, and at times turned:
    what lies beyond the image then shows nothing."""
    channels, labels = examples.channels[row], examples.labels[row]
    step = 1 / np.exp(rng.uniform(*np.log(ZOOM)))
    cut = _turned if rng.random() < TURNED else _upright
    channels, labels = cut(channels, labels, size, step, rng)
    if rng.random() < 0.5:
        channels, labels = channels[..., ::-1].copy(), labels[..., ::-1]
        channels[SIDEWAYS] *= -1
    return channels, labels


def _upright(
    channels: NDArray[np.int8],
    labels: NDArray[np.uint8],
    size: tuple[int, int],
    step: float,
    rng: np.random.Generator,
) -> tuple[NDArray[np.int8], NDArray[np.uint8]]:
    """A window anywhere within the image."""
    places = []
    for length, whole in zip(size, labels.shape, strict=True):
        step_here = min(step, whole / length)
        start = rng.uniform(0, whole - step_here * length)
        places.append((start + step_here * np.arange(length)).astype(np.int64))
    chosen = np.ix_(*places)
    return channels[:, *chosen].copy(), labels[chosen]


def _turned(
    channels: NDArray[np.int8],
    labels: NDArray[np.uint8],
    size: tuple[int, int],
    step: float,
    rng: np.random.Generator,
) -> tuple[NDArray[np.int8], NDArray[np.uint8]]:
    """A window about a point in the middle half of the image, turned by any angle."""
    angle = rng.uniform(-np.pi, np.pi)
    cos, sin = np.cos(angle), np.sin(angle)
    down, right = (
        step * (np.arange(length) - length / 2)[shape]
        for length, shape in zip(size, (np.s_[:, None], np.s_[None]), strict=True)
    )
    middle = [rng.uniform(0.25, 0.75) * length for length in labels.shape]
    rows = np.floor(middle[0] + cos * down + sin * right).astype(np.int64)
    columns = np.floor(middle[1] - sin * down + cos * right).astype(np.int64)
    inside = (rows >= 0) & (rows < labels.shape[0]) & (columns >= 0) & (columns < labels.shape[1])
    rows, columns = (np.where(inside, each, 0) for each in (rows, columns))
    found = np.where(inside, channels[:, rows, columns], 0).astype(np.int8)
    x, y = found[SIDEWAYS].astype(np.float32), found[SIDEWAYS + 1].astype(np.float32)
    found[SIDEWAYS] = np.rint(cos * x + sin * y)
    found[SIDEWAYS + 1] = np.rint(cos * y - sin * x)
    return found, np.where(inside, labels[rows, columns], 0).astype(np.uint8)


def _other_colours(
    colour: NDArray[np.float32],
    normals: NDArray[np.float32],
    labels: NDArray[np.uint8],
    rng: np.random.Generator,
) -> NDArray[np.float32]:
    """Colours (3, h, w), -1 to 1, in other light and by another camera, on things of other
    colours. normals : (3, h, w), 0 where there is none"""
    if rng.random() < BLANK:
        return np.zeros_like(colour)
    light = (colour + 1) / 2
    if rng.random() < REPAINTED:
        light = _repainted(light, labels, rng)
    if rng.random() < ONE_SIDE:
        light = light * _from_one_side(normals, rng)
    if rng.random() < SPOTS:
        light = light * np.clip(1 + 0.3 * _smooth(labels.shape, 12, rng), 0.3, 1.5)
    if rng.random() < 0.5:
        light = light[rng.permutation(3)]
    if rng.random() < GREY:
        light = np.broadcast_to(light.mean(axis=0), light.shape)
    gain = np.exp(rng.normal(0, BRIGHTNESS) + rng.normal(0, TINT, (3, 1, 1)))
    light = np.clip(light * gain, 1e-3, 1) ** np.exp(rng.normal(0, GAMMA))
    light += rng.normal(0, NOISE * rng.random(), light.shape)
    light = np.clip(light, 0, 1).astype(np.float32)
    if rng.random() < BLURRED:
        over = int(rng.choice(BLURS))
        blurred = avg_pool2d(torch.from_numpy(light), over, 1, over // 2, count_include_pad=False)
        light = blurred.numpy()
    return np.asarray(2 * light - 1, np.float32)


def _repainted(
    light: NDArray[np.float32], labels: NDArray[np.uint8], rng: np.random.Generator
) -> NDArray[np.float32]:
    """(3, h, w) some objects, and often the table, in other colours, plain or printed, in the light
    that there is."""
    things = int(labels.max()) + 1
    printed = rng.random(things) < PRINTED
    ink = np.where(printed[labels], _print(labels.shape, rng), 0)
    inks = rng.random((things, INKS, 3)).astype(np.float32)
    shade = light.mean(axis=0)
    mean = np.bincount(labels.ravel(), shade.ravel(), things) / np.maximum(
        np.bincount(labels.ravel(), minlength=things), 1
    )
    painted = inks[labels, ink].transpose(2, 0, 1) * np.clip(
        shade / np.maximum(mean, 0.02)[labels], 0, 2
    )
    chosen = rng.random(things) < np.where(np.arange(things) == 0, TABLE, EACH)
    return np.where(chosen[labels], np.clip(painted, 0, 1), light).astype(np.float32)


def _from_one_side(normals: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """(h, w) how bright surfaces with normals (3, h, w) are where a lamp stands anywhere: of a mug
    the inside is dark, or alone bright. Missing normals are those of the nearest pixel, so that
    silhouettes stay as they are."""
    missing = ~normals.any(axis=0)
    if missing.all():
        return np.ones(normals.shape[1:], np.float32)
    nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
    lamp = rng.normal(size=3)
    facing = np.tensordot(lamp / np.linalg.norm(lamp), normals[:, *nearest], axes=1)
    smooth = uniform_filter(facing, 3)
    return np.asarray(np.clip(1 + rng.uniform(0.2, 0.9) * smooth, 0.1, 2), np.float32)


def _print(shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.int64]:
    """(h, w) numbers of inks: squares, stripes or stains, of any size, with sharp edges."""
    size, turn = np.exp(rng.uniform(*np.log(PRINTS))), rng.uniform(0, np.pi)
    rows, columns = np.indices(shape)
    across = (np.cos(turn) * columns + np.sin(turn) * rows) / size
    down = (np.cos(turn) * rows - np.sin(turn) * columns) / (size * rng.uniform(0.3, 1))
    kind = rng.integers(4)
    if kind == 0:  # a chessboard, of two inks
        return (np.floor(across).astype(np.int64) + np.floor(down).astype(np.int64)) % 2
    if kind == 1:  # stripes
        return np.floor(across).astype(np.int64) % INKS
    if kind == 2:  # panels of any ink
        table = rng.integers(INKS, size=(64, 64))
        return table[np.floor(across).astype(np.int64) % 64, np.floor(down).astype(np.int64) % 64]
    stains = _smooth(shape, int(3 + 480 / size), rng) + 0.3 * _smooth(shape, 90, rng)
    return np.digitize(stains, [-0.5, 0.0, 0.5])


def _smooth(shape: tuple[int, ...], most: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """(h, w) values about 0, smooth over an image of 2 to `most` cells along each axis."""
    cells = tuple(int(rng.integers(2, max(most, 3))) for _ in range(2))
    drawn = torch.from_numpy(rng.normal(0, 1, (1, 1, *cells)).astype(np.float32))
    found = interpolate(drawn, shape, mode="bilinear", align_corners=False)
    return np.asarray(found[0, 0].numpy())


def _cut_holes(channels: NDArray[np.float32], rng: np.random.Generator) -> None:
    """Take depth out of some boxes of an image (CHANNELS, h, w)."""
    height, width = channels.shape[1:]
    for _ in range(int(rng.integers(1, MOST_HOLES))):
        row, column = int(rng.integers(height)), int(rng.integers(width))
        rows, columns = (int(each) for each in np.exp(rng.uniform(0, np.log(LARGEST_HOLE), 2)))
        geometry = np.s_[COLOURS.stop : CHANNELS, row : row + rows, column : column + columns]
        channels[geometry] = 0
