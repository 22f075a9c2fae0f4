"""How probable a frame is if a stored object stands where a placement has it, against that it is
none of the stored ones: log likelihood ratios, in nats.

The placed mesh is rendered into a grid of the frame's rays, and what it shows is compared with what
was measured:

    depth        own pixels that the mesh shows: of the mean residual r of each patch, along the
                 normal, ln [(1 - e) N(r; 0, v) + e U] - ln [(1 - e') N(r; 0, v + s^2) + e' U];
                 v is the sensor's variance there (observation/pixel_noise.py), s how far a shape
                 that is another one is off where it was fitted, e and e' the shares of strays
    misfit       how many of the sensor's standard deviations the patches are off on average, over
                 how many of them err as one
    silhouette   own pixels that the mesh leaves bare, or covers
    free space   pixels of others which the mesh would hide and does not
    unmasked     pixels that the mesh would show, by their depth, and that belong to no object: each
                 as far as its colour is that of the surroundings and not the object's
    below        model surface under the table
    colour       how well what is printed on it agrees with the image

Another object that stands in front excuses, and so do pixels without depth and pixels at the mask's
edge, which sensors blur. What is counted are votes: so many patches as err independently. However
many there are, they count as `most_votes` at most: that the stored mesh or the mask is not quite
right is an error that all of them share. The coefficients are those of a logistic regression over
made scenes (docs/sensors.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import ColourConfig, LikelihoodConfig
from brrp_cli.frames.dilate import dilated
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.geometry import bounds, grid_nodes, transform_points
from brrp_cli.observation.pixel_noise import PixelNoise
from brrp_cli.observation.support_plane import Plane
from brrp_cli.registration.model import Model
from brrp_cli.registration.print_agreement import print_agreement
from brrp_cli.registration.surroundings import Surroundings, like_surroundings, surroundings

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Mean of |x| of a standard normal x.
NOISE_ALONE = float(np.sqrt(2 / np.pi))


@dataclass(frozen=True)
class SeenPixels:
    """What a frame shows of one object and around it, on every `stride`-th pixel: (h, w) arrays.

    rays : (h, w, 3), z = 1; patch : number of the patch; own : the object's, with depth; beside :
    nearer to its mask than sensors blur; on_table : as high as the table; background : no object's;
    depth : metres, NaN where there is none; fine : metres; steady : away from jumps of depth
    wave : metres, of patches; rays_per_patch, patches_per_vote : 1 or more; colours : of the object
    and around it; lost : (H, W) its pixels without depth, where that shows too little of it
    """

    frame: Frame
    plane: Plane | None
    stride: int
    rays: Array
    patch: NDArray[np.int64]
    own: Mask
    beside: Mask
    on_table: Mask
    background: Mask
    depth: Array
    fine: NDArray[np.float32]
    steady: Mask
    wave: float
    rays_per_patch: float
    patches_per_vote: float
    bleed: int
    colours: Surroundings
    lost: Mask | None


@dataclass(frozen=True)
class PlacementEvidence:
    """What a rendered placement and the frame have to say to each other.

    residual, variance, share : (n,) of patches: mean of measured minus rendered depth along the
    normal, metres; of it by the sensor, metres^2; part of a patch that is seen
    missed, covered : votes of the object's pixels that the mesh leaves bare and that it covers
    free : votes of pixels that the mesh would hide, and where something behind it was seen
    unmasked : votes of pixels of no object that the mesh would show, in the surroundings' colours
    below : share of the model's surface under the table
    colour : correlation, -1 to 1, of what is printed on it with the image
    """

    residual: Array
    variance: Array
    share: Array
    patches_per_vote: float
    missed: float
    covered: float
    free: float
    unmasked: float
    below: float
    colour: float


def see(
    frame: Frame,
    object_id: int,
    plane: Plane | None,
    noise: PixelNoise,
    patch: float,
    bleed: float,
    config: LikelihoodConfig,
    lost: Mask | None = None,
) -> SeenPixels:
    """One object of a frame, for as many placements as there are.

    patch : metres; bleed : radians by which silhouettes are uncertain; lost : as of `SeenPixels`
    """
    mask = frame.segmap == object_id
    middle = float(np.median(frame.points[mask & frame.valid][:, 2]))
    focal = float(frame.K[0, 0])
    cell = max(2.0, patch * focal / middle)
    stride = max(1, round(cell / config.rays_across_patch))
    blur = max(1, round(bleed * focal))
    beside = dilated(mask, blur)
    part = (slice(None, None, stride), slice(None, None, stride))
    v, u = np.mgrid[: frame.shape[0] : stride, : frame.shape[1] : stride]
    valid = frame.valid[part]
    depth = np.where(valid, frame.points[part][..., 2], np.nan).astype(np.float64)
    on_table = np.zeros(valid.shape, dtype=np.bool_)
    if plane is not None:
        on_table = plane.signed_distance(frame.points[part]) < config.on_table
    own, background = mask[part] & valid, frame.segmap[part] == BACKGROUND
    across = int(np.ceil(frame.shape[1] / cell)) + 1
    return SeenPixels(
        frame=frame,
        plane=plane,
        stride=stride,
        rays=np.stack(
            [(u - frame.K[0, 2]) / focal, (v - frame.K[1, 2]) / frame.K[1, 1], np.ones(u.shape)],
            axis=-1,
        ),
        patch=(v // cell).astype(np.int64) * across + (u // cell).astype(np.int64),
        own=own,
        beside=beside[part],
        on_table=on_table,
        background=background,
        depth=depth,
        fine=noise.fine[part],
        steady=~noise.at_jump[part],
        wave=noise.wave_at(middle),
        rays_per_patch=(cell / stride) ** 2,
        patches_per_vote=noise.patches_per_vote,
        bleed=max(1, round(blur / stride)),
        colours=surroundings(frame.rgb[part], own, background, config.colours),
        lost=lost,
    )


def evidence(
    T_cam_model: Array,
    model: Model,
    seen: SeenPixels,
    config: LikelihoodConfig,
    colour: ColourConfig,
) -> PlacementEvidence:
    """A placement T_cam_model (4, 4), affine, of a model, against the frame."""
    from scipy.ndimage import binary_dilation

    part = _window(T_cam_model, model, seen)
    rays, depth, own = seen.rays[part], seen.depth[part], seen.own[part]
    # The rays have z = 1: how often they go is the depth itself.
    rendered, normals = model.stored.shape.met(T_cam_model @ model.T_model_object, rays)
    lean = np.abs(np.einsum("hwi,hwi->hw", normals, rays)) / np.linalg.norm(rays, axis=-1)
    hit = np.isfinite(rendered)
    near_hit = binary_dilation(hit, iterations=seen.bleed)
    with np.errstate(invalid="ignore"):
        behind = np.where(hit, depth - rendered, np.nan)
        beyond = ~own & ~seen.beside[part]
        free = beyond & (behind > config.free)
        shown = beyond & seen.background[part] & (np.abs(behind) <= config.free)
    missed = own & ~near_hit & ~seen.on_table[part]
    residual, variance, share = _patches(
        own & hit & seen.steady[part], behind, lean, seen.patch[part], seen.fine[part], seen, config
    )
    votes = seen.rays_per_patch * seen.patches_per_vote
    return PlacementEvidence(
        residual=residual,
        variance=variance,
        share=share,
        patches_per_vote=seen.patches_per_vote,
        missed=float(missed.sum() / votes),
        covered=float((own & near_hit).sum() / votes),
        free=float(free.sum() / votes),
        unmasked=_surrounding(shown, part, seen, config) / votes,
        below=_below(T_cam_model, model, seen.plane, config),
        colour=print_agreement(T_cam_model, model, seen.frame, colour, seen.lost)
        if model.stored.record.get("coloured")
        else 0.0,
    )


def log_likelihood(found: PlacementEvidence, config: LikelihoodConfig) -> float:
    """Nats by which the frame is more probable with the placement than with none of the stored
    objects."""
    votes = float(found.share.sum() / found.patches_per_vote)
    depth = float((found.share * depth_ratio(found, config)).sum() / found.patches_per_vote)
    counted = (
        config.depth * depth
        - config.missed * found.missed
        + config.covered * found.covered
        - config.free_space * found.free
        - config.unmasked * found.unmasked
    ) / (1 + votes / config.most_votes)
    return (
        config.base
        + counted
        - config.misfit * misfit(found, config)
        - config.below * found.below
        + config.colour * found.colour
    )


def depth_ratio(found: PlacementEvidence, config: LikelihoodConfig) -> Array:
    """ln p(residual | placed) - ln p(residual | another shape) of each patch (n,)."""

    def density(variance: Array, strays: float) -> Array:
        normal = np.exp(-0.5 * found.residual**2 / variance) / np.sqrt(2 * np.pi * variance)
        return np.asarray((1 - strays) * normal + strays / (2 * config.reach))

    placed = density(found.variance, config.strays)
    other = density(found.variance + config.other_shape**2, config.other_strays)
    return np.asarray(np.log(placed) - np.log(other))


def misfit(found: PlacementEvidence, config: LikelihoodConfig) -> float:
    """Mean over patches of |residual| in the sensor's standard deviations, over how many patches
    err as one; what noise alone makes where none is compared.

    A shape that looks alike is off by little, but everywhere. Long waves of a sensor are so, too:
    where they are long, this says little.
    """
    compared = float(found.share.sum())
    if not compared:
        return NOISE_ALONE / found.patches_per_vote
    off = np.minimum(np.abs(found.residual) / np.sqrt(found.variance), config.most_deviations)
    return float((found.share * off).sum() / compared / found.patches_per_vote)


def _window(T_cam_model: Array, model: Model, seen: SeenPixels) -> tuple[slice, slice]:
    """The part of the grid that holds the object and the placed model."""
    points = transform_points(T_cam_model, _corners(model))
    rows, columns = (np.flatnonzero(seen.own.any(axis=axis)) for axis in (1, 0))
    limits = [(rows[0], rows[-1]), (columns[0], columns[-1])] if len(rows) else [(0, 0), (0, 0)]
    z = points[:, 2]
    if (z <= 0).any():  # reaches behind the camera
        return slice(None), slice(None)
    K, window = seen.frame.K, []
    for axis, (low, high), size in zip((1, 0), limits, seen.own.shape, strict=True):
        at = (points[:, axis] / z * K[axis, axis] + K[axis, 2]) / seen.stride
        low, high = min(low, int(np.floor(at.min()))), max(high, int(np.ceil(at.max())))
        window.append(slice(max(low - seen.bleed, 0), min(high + seen.bleed + 1, size)))
    return window[0], window[1]


def _corners(model: Model) -> Array:
    return grid_nodes(np.stack(bounds(model.surface)).T).reshape(-1, 3)


def _patches(
    compared: Mask,
    behind: Array,
    lean: Array,
    patch: NDArray[np.int64],
    fine: NDArray[np.float32],
    seen: SeenPixels,
    config: LikelihoodConfig,
) -> tuple[Array, Array, Array]:
    """Residual, variance and share (n,) of the patches of which enough is compared."""
    _, number = np.unique(patch[compared], return_inverse=True)
    count = np.bincount(number)

    def mean(values: NDArray[np.floating]) -> Array:
        return np.asarray(np.bincount(number, values[compared]) / np.maximum(count, 1))

    if not len(count):
        return np.zeros(0), np.zeros(0), np.zeros(0)
    residual = mean(np.clip(behind, -config.reach, config.reach) * lean)
    by_sensor = (seen.wave**2 + mean(fine) ** 2 / count) * mean(lean**2)
    variance = by_sensor + config.stored_off**2
    share = np.minimum(count / seen.rays_per_patch, 1.0)
    enough = share >= config.least_share
    return residual[enough], variance[enough], share[enough]


def _surrounding(
    shown: Mask, part: tuple[slice, slice], seen: SeenPixels, config: LikelihoodConfig
) -> float:
    """How many of the pixels `shown` of a part have the surroundings' colours."""
    rgb = seen.frame.rgb[:: seen.stride, :: seen.stride][part][shown]
    return float(like_surroundings(rgb, seen.colours, config.colour_spread).sum())


def _below(
    T_cam_model: Array, model: Model, plane: Plane | None, config: LikelihoodConfig
) -> float:
    if plane is None:
        return 0.0
    surface = model.surface[: config.surface_points]
    depth = -plane.signed_distance(transform_points(T_cam_model, surface))
    return float(np.clip((depth - config.tolerance) / config.slope, 0, 1).mean())
