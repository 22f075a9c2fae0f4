"""Which of the large planes bears the things: a table or a board of a shelf, no wall or floor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.observation import ObservationConfig, SupportConfig
from brrp_cli.geometry import IMAGE_UP, cells_of, lengths
from brrp_cli.observation.patches import Patch, Ransac, largest_planes, patch_with_hidden
from brrp_cli.observation.support_plane import Plane, fit_plane
from brrp_cli.seeds import child_rng, child_seed

Points = NDArray[np.floating]


def supporting_plane(
    points: Points, things: Points, config: ObservationConfig, seed: int, toward: Points
) -> Plane | None:
    """The largest plane of the background, as `fit_plane` finds it, or that one which bears the
    objects.

    points : (n, 3) of the background; things : (m, 3) of the objects; toward : (3,) the scene's
    centre; metres, camera frame. None where no plane is found.
    """
    largest = fit_plane(points, config, seed, toward)
    if largest is None or config.support is None:
        return largest
    near = points[lengths(points - toward) < config.plane_radius]
    rng = child_rng(seed, "patches")
    near, things = (_drawn(each, config.support.points, rng) for each in (near, things))
    planes = largest_planes(
        near,
        child_seed(seed, "patches"),
        config.support,
        Ransac(
            config.plane_tolerance,
            config.plane_iterations,
            config.plane_ransac_points,
            config.plane_min_points,
        ),
        first=largest,
    )
    if len(planes) < 2:
        return largest
    patches = [
        patch
        for plane, _ in planes
        if (patch := patch_with_hidden(plane, near, config.plane_tolerance, config.support))
    ]
    usual = next((patch for patch in patches if patch.plane is largest), None)
    return largest if usual is None else bearing(patches, usual, near, things, config.support).plane


def _drawn(points: Points, most: int, rng: np.random.Generator) -> NDArray[np.float64]:
    if len(points) > most:
        points = points[rng.choice(len(points), most, replace=False)]
    return points.astype(np.float64)


def bearing(
    patches: Sequence[Patch],
    usual: Patch,
    points: Points,
    things: Points | None,
    config: SupportConfig,
) -> Patch:
    """The patch on which most stands, or `usual` where on none stands much more.

    points : (n, 3) metres, camera frame; things : (m, 3) of what stands there; None: what is off
    every patch
    """
    if len(patches) < 2:
        return usual
    whole = [each for each in patches if each.is_whole(points, config)]
    # What goes through a heap tells no directions, nor does the face of a thing near the camera.
    wide = [each for each in whole if each.across >= config.across]
    main = usual if _holds(wide, usual) else max(wide, key=lambda e: e.count, default=usual)
    large: list[Patch] = []
    for each in sorted(whole, key=lambda e: -e.count):
        # What lies a little over a larger one is faces of what stands on that.
        if each is main or (
            _is_furniture(each, main, points, config)
            and all(_are_apart(each, other, points, config) for other in large)
        ):
            large.append(each)
    asked = [*large, usual] if _holds(whole, usual) and not _holds(large, usual) else large
    if things is None:
        things = _off_all(asked, points, config.off)
    bears = {id(each): _bears(each, things, config) for each in asked}
    by_usual = bears.get(id(usual), np.zeros(2))
    better = [
        each
        for each in large
        if each.count >= config.of_largest * usual.count
        and bears[id(each)][0] >= config.fewest
        and (bears[id(each)] > _times(each, usual, config) * by_usual).all()
    ]
    return max(better, key=lambda each: bears[id(each)].prod(), default=usual)


def _holds(patches: Sequence[Patch], one: Patch) -> bool:
    return any(each is one for each in patches)


def _bears(patch: Patch, things: Points, config: SupportConfig) -> NDArray[np.float64]:
    """`standing_on`, which counts for more where the patch faces up in the image."""
    upright = max(float(patch.plane.normal @ IMAGE_UP), 0.0)
    return np.array(standing_on(patch, things, config)) * (1 + config.up * upright)


def _is_furniture(patch: Patch, usual: Patch, points: Points, config: SupportConfig) -> bool:
    """Whether a patch is no face of a thing on the usual one: it is large, and square to that or
    parallel and far from it."""
    alike = abs(patch.plane.normal @ usual.plane.normal)
    if patch.across < config.across:
        return False
    square = alike < np.sin(np.radians(config.turn))
    parallel = _are_parallel(patch, usual, config) and _are_apart(patch, usual, points, config)
    return bool(square or parallel)


def _are_apart(patch: Patch, other: Patch, points: Points, config: SupportConfig) -> bool:
    """Whether a patch is not parallel and near to another one."""
    if not _are_parallel(patch, other, config):
        return True
    on = points[np.abs(patch.plane.signed_distance(points)) < config.off]
    return float(np.median(np.abs(other.plane.signed_distance(on)))) > config.apart


def _are_parallel(one: Patch, other: Patch, config: SupportConfig) -> bool:
    return bool(abs(one.plane.normal @ other.plane.normal) > np.cos(np.radians(config.turn)))


def _times(patch: Patch, usual: Patch, config: SupportConfig) -> float:
    """How many times as much must stand on a patch: what is on a floor is no matter of a table."""
    beneath = patch.plane.offset > usual.plane.offset
    return config.beneath if beneath and _are_parallel(patch, usual, config) else config.times


def _off_all(patches: Sequence[Patch], points: Points, off: float) -> Points:
    away = np.ones(len(points), dtype=bool)
    for each in patches:
        away &= np.abs(each.plane.signed_distance(points)) > off
    return points[away]


def standing_on(patch: Patch, things: Points, config: SupportConfig) -> tuple[int, int]:
    """In how many cells of a patch something stands, and how many of things (n, 3), metres, camera
    frame, these are: the lowest in a cell is within `config.low` of the patch."""
    height = patch.plane.signed_distance(things)
    above = (height > 0) & (height < config.high)
    above[above] = patch.holds(patch.plan(things[above]), config.off)
    if not above.any():
        return 0, 0
    number = cells_of(patch.plan(things[above]), config.cell)
    count = np.bincount(number)
    lowest = np.full(len(count), np.inf)
    np.minimum.at(lowest, number, height[above])
    stands = lowest < config.low
    return int(stands.sum()), int(count[stands].sum())
