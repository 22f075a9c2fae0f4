"""What a frame shows of its large planes."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.observation import SupportConfig
from brrp_cli.dependencies import import_library
from brrp_cli.geometry import bounds
from brrp_cli.hulls import convex_hull
from brrp_cli.observation.outlined import Outlined
from brrp_cli.observation.support_plane import Plane, largest_plane
from brrp_cli.seeds import child_seed

Points = NDArray[np.floating]


@dataclass(frozen=True)
class Patch(Outlined):
    """The part of a plane that hangs together.

    count : points near the plane; across : metres between the ends of its hull
    """

    count: int
    across: float

    def is_whole(self, points: Points, config: SupportConfig) -> bool:
        """Whether next to nothing of points (n, 3), metres, camera frame, is seen behind it: not so
        what goes through a heap of things, or through the front edges of a shelf."""
        return self.seen_through(points, config.off) <= config.through * self.count

    def seen_through(self, points: Points, off: float) -> int:
        """How many of points (n, 3), metres, camera frame, are seen behind it, more than `off`
        metres from its plane and from its outline: none, if it is one surface."""
        behind = points[self.plane.signed_distance(points) < -off]
        return int(self.holds(self.plan(self.plane.met_by(behind)), -off).sum())


@dataclass(frozen=True)
class Ransac:
    """What `largest_plane` asks for; tolerance in metres."""

    tolerance: float
    iterations: int
    drawn_points: int
    min_points: int

    def drawing(self, part: float) -> Ransac:
        """The same of a part of the points, as densely drawn."""
        drawn = max(self.min_points, round(part * self.drawn_points))
        return replace(self, drawn_points=drawn)


def patch_of(plane: Plane, points: Points, tolerance: float, cell: float) -> Patch | None:
    """The patch of points (n, 3), metres, camera frame, that are nearer to a plane than
    `tolerance`, on a grid of `cell` metres; None where it has no extent."""
    axes, count, pieces = _pieces(plane, points, tolerance, cell)
    return _patch(plane, axes, pieces[0], count) if pieces else None


def patch_with_hidden(
    plane: Plane, points: Points, tolerance: float, config: SupportConfig
) -> Patch | None:
    """As `patch_of`, with what lies on the other side of things: large pieces of the plane between
    which nothing is seen behind it. Things that go across the image part a table so."""
    axes, count, pieces = _pieces(plane, points, tolerance, config.patch)
    found = _patch(plane, axes, pieces[0], count) if pieces else None
    for piece in pieces[1:]:
        if found is None or len(piece) < config.piece * len(pieces[0]):
            break
        on = np.concatenate([pieces[0], piece])
        joined = _patch(plane, axes, on, count)
        if joined is None:
            continue
        more = joined.seen_through(points, config.off) - found.seen_through(points, config.off)
        if more <= config.through * len(piece):
            pieces[0], found = on, joined
    return found


def axes_of(plane: Plane) -> NDArray[np.float64]:
    """(2, 3) unit, spanning a plane: plan coordinates are points @ axes.T."""
    return np.asarray(np.linalg.svd(plane.normal[None])[2][1:])


def _pieces(
    plane: Plane, points: Points, tolerance: float, cell: float
) -> tuple[NDArray[np.float64], int, list[NDArray[np.float64]]]:
    """Axes of a plane's plan, how many of points (n, 3) are near it, and the plan points (m, 2) of
    each piece of it that hangs together, the largest first."""
    axes = axes_of(plane)
    near = points[np.abs(plane.signed_distance(points)) < tolerance]
    return axes, len(near), _hanging_together(near @ axes.T, cell) if len(near) else []


def _patch(
    plane: Plane, axes: NDArray[np.float64], on: NDArray[np.float64], count: int
) -> Patch | None:
    """The patch of plan points (n, 2); None where they have no extent."""
    hull = convex_hull(on)
    if hull is None:
        return None
    # The ends of it in each of its directions, which are many enough.
    least, most = bounds(on @ hull[:, :2].T)
    across = float((most - least).max())
    return Patch(plane, axes, hull, count, across)


def largest_planes(
    points: NDArray[np.float64],
    seed: int,
    config: SupportConfig,
    ransac: Ransac,
    first: Plane | None = None,
) -> list[tuple[Plane, int]]:
    """The planes with most of points (n, 3), metres, camera frame, with their counts, most first.

    They are found one after the other among the points that are left. first : of them, where it is
    known
    """
    planes: list[tuple[Plane, int]] = []
    rest = points
    least = config.least * len(points)
    for index in range(config.candidates):
        # Where no second plane is large enough, the first is the table, and others are its things.
        enough = config.of_largest * planes[0][1] if index == 1 else 0.0
        if not len(rest) or len(rest) < max(least, enough):
            break
        if first is not None and not index:
            plane: Plane | None = first
        else:
            own = ransac.drawing(len(rest) / len(points))
            plane = largest_of(rest, child_seed(seed, "table", index), own)
        if plane is None:
            break
        inlier = np.abs(plane.signed_distance(rest)) < ransac.tolerance
        if inlier.sum() < least:
            break
        planes.append((plane, int(inlier.sum())))
        rest = rest[~inlier]
        if inlier.sum() < enough:
            break
    return sorted(planes, key=lambda pair: -pair[1])


def largest_of(points: NDArray[np.float64], seed: int, ransac: Ransac) -> Plane | None:
    """The plane with most of points (n, 3), metres, camera frame; None where there is none."""
    model = largest_plane(points, seed, **asdict(ransac))
    return None if model is None else Plane.facing_the_camera(model)


def _hanging_together(plan: NDArray[np.float64], cell: float) -> list[NDArray[np.float64]]:
    """Plan points (n, 2) by the patches that they make up, the largest first: a floor beyond the
    edge is no table."""
    ndimage = import_library("scipy.ndimage")
    cells = np.floor(plan / cell).astype(np.int64)
    first, last = bounds(cells)
    cells -= first
    grid = np.zeros(last - first + 1, dtype=bool)
    grid[tuple(cells.T)] = True
    # Objects hide parts of the table behind them: patches up to 8 cm apart are one.
    joined, _ = ndimage.label(ndimage.binary_dilation(grid, iterations=2))
    patch = joined[tuple(cells.T)]
    counts = np.bincount(patch)
    largest_first = np.argsort(-counts, kind="stable")
    return [plan[patch == i] for i in largest_first if counts[i]]
