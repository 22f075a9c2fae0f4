"""The stored shapes in their resting poses, ready to be stretched: what kin are made of.

A shape in a resting pose is a *stance*. Its frame has z up and x, y along the smallest rectangle
about its footprint; u are coordinates in its box, -1 to 1 on each axis.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label
from scipy.spatial import ConvexHull

from brrp_cli.config import KinConfig
from brrp_cli.geometry import turn_about_z
from brrp_cli.prior.distance_field import DistanceField
from brrp_cli.prior.shard import DISTANCES
from brrp_cli.prior.store import Prior

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

# What is read of each object.
PARTS = (
    "box",
    "surface",
    "pose_T",
    "pose_probability",
    f"{DISTANCES}/lower",
    f"{DISTANCES}/spacing",
    f"{DISTANCES}/values",
)
# Normalised, of a sheet.
LEAST_HALF = 1e-3


@dataclass(frozen=True)
class Fields:
    """The distance fields of all shapes, one after the other.

    values : all nodes; first : (O,) of each field's first; shape : (O, 3) nodes along its axes;
    lower : (O, 3), spacing : (O,) normalised
    """

    values: NDArray[np.float16]
    first: NDArray[np.int64]
    shape: NDArray[np.int32]
    lower: Floats
    spacing: Floats

    def distance_and_gradient(
        self, number: NDArray[np.int64], points: Floats
    ) -> tuple[Floats, Floats]:
        """Distance (B, n) and gradient (3, B, n) of the shapes `number` (B,) at points (3, B, n),
        all normalised: trilinear, off the grid as `DistanceField.signed_distance`."""
        shape = self.shape[number].T[:, :, None]
        spacing = self.spacing[number][:, None]
        at = (points - self.lower[number].T[:, :, None]) / spacing
        within = np.clip(at, 0, (shape - 1).astype(np.float32))
        cell = np.minimum(within.astype(np.int32), shape - 2)
        # Less the whole numbers as floats: with integers, NumPy would go on in double precision.
        x, y, z = within - cell.astype(np.float32)
        on_y = shape[2].astype(np.int64)
        on_x = on_y * shape[1]
        first = self.first[number][:, None] + cell[0] * on_x + cell[1] * on_y + cell[2]
        corner = [
            (self.values.take(first + step), self.values.take(first + step + 1))
            for step in (0, on_y, on_x, on_x + on_y)
        ]
        low = [one.astype(np.float32) for one, _ in corner]
        rise = [two.astype(np.float32) - one for one, (_, two) in zip(low, corner, strict=True)]
        edges = [start + z * up for start, up in zip(low, rise, strict=True)]
        left, right = edges[1] - edges[0], edges[3] - edges[2]
        near, far = edges[0] + y * left, edges[2] + y * right
        up_near, up_far = rise[0] + y * (rise[1] - rise[0]), rise[2] + y * (rise[3] - rise[2])
        slope = np.empty((3, *x.shape), np.float32)
        np.subtract(far, near, out=slope[0])
        value = near + x * slope[0]
        np.add(left, x * (right - left), out=slope[1])
        np.add(up_near, x * (up_far - up_near), out=slope[2])
        slope /= spacing
        off = (at - within) * spacing
        beyond = off.any(axis=0)
        if beyond.any():
            way = np.linalg.norm(off[:, beyond], axis=0)
            value[beyond] += way
            slope[:, beyond] = np.where(off[:, beyond] != 0, off[:, beyond] / way, slope[:, beyond])
        return value, slope


@dataclass(frozen=True)
class Library:
    """All stances of the stored shapes.

    names : of O objects; units : (O,) metres of one unit of an object's normalised coordinates
    object : (E,) of each stance; half : (E, 3) metres, half of the sides of its box
    to_object : (E, 3, 3), (E, 3): normalised coordinates of the object are to_object @ u + origin
    coarse : (E, nodes**3, 4) distance, metres, and the squares of its unit gradient, at nodes of u
    between -reach and reach; surface : (E, n, 3) points of the surface, u
    hollow : (E,) share of the points halfway between two of the surface that lie outside
    """

    names: list[str]
    units: Floats
    fields: Fields
    object: NDArray[np.int64]
    half: Floats
    to_object: Floats
    origin: Floats
    coarse: NDArray[np.float16]
    surface: Floats
    hollow: Floats
    reach: float


@dataclass(frozen=True)
class KinShape:
    """What a library needs of a stored object, normalised: its field, points (n, 3) of its surface,
    rotations (3, 3) to its resting poses with their probabilities; unit : metres of one unit."""

    name: str
    unit: float
    field: DistanceField
    surface: Floats
    rotations: Array
    probabilities: Array


def library_of_prior(prior: Prior, config: KinConfig) -> Library:
    """That of a prior: about 25 ms an object, most of it to read the shards. Errors: PriorError."""
    return library_of(list(_shapes(prior, config)), config)


def _shapes(prior: Prior, config: KinConfig) -> Iterator[KinShape]:
    """Of `config.objects` objects at most, evenly over the names."""
    count = len(prior.names)
    rows = np.unique(np.linspace(0, count - 1, min(count, config.objects)).astype(np.int64))
    for name, arrays in prior.parts([prior.names[row] for row in rows], PARTS):
        lower, upper = arrays["box"]
        yield KinShape(
            name,
            float((upper - lower).max() / 2),
            DistanceField(
                arrays[f"{DISTANCES}/lower"],
                float(arrays[f"{DISTANCES}/spacing"][0]),
                arrays[f"{DISTANCES}/values"],
            ),
            arrays["surface"],
            arrays["pose_T"][:, :3, :3],
            arrays["pose_probability"],
        )


def library_of(shapes: Sequence[KinShape], config: KinConfig) -> Library:
    """The library of some shapes, one at least."""
    starts = np.cumsum([0, *(each.field.values.size for each in shapes)])
    fields = Fields(
        np.concatenate([_filled(each.field.values).astype(np.float16).ravel() for each in shapes]),
        starts[:-1].astype(np.int64),
        np.array([each.field.values.shape for each in shapes], np.int32),
        np.array([each.field.lower for each in shapes], np.float32),
        np.array([each.field.spacing for each in shapes], np.float32),
    )
    units = np.array([each.unit for each in shapes], np.float32)
    stances = [(row, one) for row, each in enumerate(shapes) for one in _stances(each, config)]
    of = np.array([row for row, _ in stances], np.int64)
    half, to_object, origin, surface = (
        np.stack([one[i] for _, one in stances]).astype(np.float32) for i in range(4)
    )
    bare = Library(
        [each.name for each in shapes],
        units,
        fields,
        of,
        half * units[of, None],
        to_object,
        origin,
        np.empty((0, 0, 4), np.float16),
        surface,
        _hollow(fields, [each.surface for each in shapes], config.hollow_clear)[of],
        config.reach,
    )
    return replace(bare, coarse=_coarse(bare, config))


def _filled(values: NDArray[np.floating]) -> NDArray[np.floating]:
    """Distances (nx, ny, nz) of a shape whose closed hollows are solid: nobody sees into them, and
    a bottle stored with its inside is no bowl."""
    parts, count = label(values > 0)
    if count < 2:
        return values
    border = np.ones(values.shape, bool)
    border[1:-1, 1:-1, 1:-1] = False
    closed = (values > 0) & ~np.isin(parts, np.unique(parts[border]))
    return np.where(closed, -values, values)


def _hollow(fields: Fields, surfaces: Sequence[Floats], clear: float) -> Floats:
    """(O,) of each shape: 0 of a convex one, about a half of a bowl."""
    found = np.empty(len(surfaces), np.float32)
    for number, surface in enumerate(surfaces):
        distance, _ = fields.distance_and_gradient(np.array([number]), surface.T[:, None])
        # In random order. Those deep inside belong to what is closed.
        outer = surface[distance[0] > -clear]
        half = len(outer) // 2
        middle = ((outer[:half] + outer[half : 2 * half]) / 2).astype(np.float32)
        distance, _ = fields.distance_and_gradient(np.array([number]), middle.T[:, None])
        found[number] = (distance > clear).mean()
    return found


def _stances(shape: KinShape, config: KinConfig) -> Iterator[tuple[Array, Array, Array, Array]]:
    """half (normalised), to_object, origin, surface of each resting pose that is probable
    enough."""
    rows = np.linspace(0, len(shape.surface) - 1, config.surface_points).astype(np.int64)
    points = shape.surface.astype(np.float64)
    for number, rotation in enumerate(shape.rotations[: config.poses]):
        if number and shape.probabilities[number] < config.least_pose:
            break
        turned = _rectangle_turn(points @ rotation.T[:, :2], config.box_turns) @ rotation
        placed = points @ turned.T
        low, high = placed.min(axis=0), placed.max(axis=0)
        half, middle = np.maximum((high - low) / 2, LEAST_HALF), (high + low) / 2
        yield half, turned.T * half, turned.T @ middle, (placed[rows] - middle) / half


def _rectangle_turn(points: Array, turns: int) -> Array:
    """(3, 3) turn about z after which the smallest rectangle about points (n, 2) lies along x and
    y."""
    hull = points[ConvexHull(points).vertices]
    angles = np.linspace(0, np.pi / 2, turns, endpoint=False)
    along = np.stack([np.cos(angles), np.sin(angles)])
    first, second = hull @ along, hull @ np.stack([-along[1], along[0]])
    best = angles[np.argmin(np.ptp(first, axis=0) * np.ptp(second, axis=0))]
    return turn_about_z(-best)


def _coarse(library: Library, config: KinConfig) -> NDArray[np.float16]:
    axis = np.linspace(-config.reach, config.reach, config.nodes, dtype=np.float32)
    nodes = np.stack(np.meshgrid(axis, axis, axis, indexing="ij")).reshape(3, -1)
    found = np.empty((len(library.object), nodes.shape[1], 4), np.float16)
    for stance, number in enumerate(library.object):
        points = library.to_object[stance] @ nodes + library.origin[stance][:, None]
        distance, gradient = library.fields.distance_and_gradient(
            np.array([number]), points[:, None]
        )
        unit = library.units[number]
        along = library.to_object[stance].T @ gradient[:, 0] / library.half[stance][:, None] * unit
        along /= np.maximum(np.linalg.norm(along, axis=0), 1e-6)
        found[stance, :, 0] = distance[0] * unit
        found[stance, :, 1:] = (along**2).T
    return found
