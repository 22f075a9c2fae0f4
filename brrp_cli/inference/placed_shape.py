"""The prior mean function of a stored object that was placed in the scene.

m(x) = -d(x) / width, limited to +-limit, with d the signed distance to the placed surface,
evaluated in the model's own frame: exact within the band where the logit is not at its limit.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import grid_nodes, transform_points
from brrp_cli.hdf5 import write_compressed
from brrp_cli.prior.distance_field import DistanceField
from brrp_cli.prior.shape import StoredShape
from brrp_cli.reconstruction import Axes

if TYPE_CHECKING:
    import h5py

    from brrp_cli.hdf5 import SharedParts

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PlacedShape:
    """A stored shape where a hypothesis puts it.

    covariance : (6, 6) of a small motion, turn about the shape's origin (radians) and shift
    (metres), in the camera's axes: how well the frame fixes the placement
    T_cam_shape : (4, 4) similarity from the shape's coordinates; width : metres, scale of the
    logistic function across the surface; limit : of the logit
    kin : whether the shape was stretched to fit an object that is not the stored one but like it
    exact : metres from the surface within which distances are, 0: nowhere; None: where the logit is
    not at its limit
    alike : (K, 4, 4) T_cam_shape of other placements, turned about itself, that the frame does not
    tell apart from this one
    """

    kind: ClassVar[str] = "shape"

    name: str
    shape: StoredShape
    T_cam_shape: Array
    width: float
    limit: float
    covariance: Array
    kin: bool = False
    exact: float | None = None
    alike: Array = field(default_factory=lambda: np.empty((0, 4, 4)))

    @property
    def taken_for(self) -> str:
        """What the object is, if this is its shape: the stored object of that name, or none of
        them, "" for all kin."""
        return "" if self.kin else self.name

    @property
    def unit(self) -> float:
        """Metres of one unit of the shape's coordinates."""
        return float(np.cbrt(np.linalg.det(self.T_cam_shape[:3, :3])))

    def moved(self, T_target_cam: Array) -> PlacedShape:
        """The same in another frame, which T_target_cam (4, 4), rigid, leads to."""
        turn = np.kron(np.eye(2), T_target_cam[:3, :3])
        return replace(
            self,
            T_cam_shape=T_target_cam @ self.T_cam_shape,
            covariance=turn @ self.covariance @ turn.T,
            alike=T_target_cam @ self.alike,
        )

    @property
    def vertices(self) -> Array:
        """(n, 3) metres, camera frame."""
        vertices = transform_points(self.T_cam_shape, self.shape.vertices.astype(np.float64))
        return np.asarray(vertices, dtype=np.float64)

    @property
    def normals(self) -> Array:
        """(n, 3) unit, outward, camera frame."""
        return np.asarray(self.shape.normals @ (self.T_cam_shape[:3, :3] / self.unit).T)

    @property
    def bounds(self) -> Array:
        """(2, 3) metres, camera frame."""
        vertices = self.vertices
        return np.stack([vertices.min(axis=0), vertices.max(axis=0)])

    @property
    def deviations(self) -> Array:
        """(n,) metres, standard deviation of each vertex along its normal, by the pose alone."""
        rows = self.motion_rows
        return np.sqrt(np.einsum("ni,ij,nj->n", rows, self.covariance, rows))

    @property
    def motion_rows(self) -> Array:
        """(n, 6) how far each vertex moves along its normal under a small motion (turn, shift)."""
        normals = self.normals
        arms = self.vertices - self.T_cam_shape[:3, 3]
        return np.concatenate([np.cross(arms, normals), normals], axis=1)

    def signed_distance(self, points: NDArray[np.floating], band: float) -> Array:
        """Distance (n,), metres, of points (n, 3), camera frame; exact where it is under `band`."""
        local = transform_points(np.linalg.inv(self.T_cam_shape), np.asarray(points, np.float64))
        return self.shape.signed_distance(local, band / self.unit) * self.unit

    def logits(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """m (n,) at points (n, 3), metres, camera frame."""
        if self.exact == 0:
            local = transform_points(np.linalg.inv(self.T_cam_shape), np.asarray(points))
            distance = self.shape.field.signed_distance(local) * self.unit
        else:
            # Where the logit is at its limit, distances need not be exact.
            band = self.limit * self.width
            distance = self.signed_distance(points, min(band, self.exact or band))
        limited = np.clip(-distance / self.width, -self.limit, self.limit)
        return np.asarray(limited, dtype=np.float32)

    def volume(self, axes: Axes) -> NDArray[np.float32]:
        """m (nx, ny, nz) on a grid of camera-frame coordinates, metres."""
        nodes = grid_nodes(axes)
        return self.logits(nodes.reshape(-1, 3)).reshape(nodes.shape[:3])

    def write(self, group: h5py.Group, shared: SharedParts) -> None:
        """Attributes name, T_cam_shape (4, 4), width, limit, covariance (6, 6), kin, exact
        and alike where they apply, and shape, the name of the shape among what the objects
        share."""
        group.attrs.update({"name": self.name, "T_cam_shape": self.T_cam_shape})
        group.attrs.update({"width": self.width, "limit": self.limit})
        group.attrs["covariance"] = self.covariance
        if self.kin:
            group.attrs["kin"] = True
        if self.exact is not None:
            group.attrs["exact"] = self.exact
        if len(self.alike):
            group.attrs["alike"] = self.alike
        group.attrs["shape"] = shared.write("shape", self.shape, _write_shape)

    @classmethod
    def read(cls, group: h5py.Group, shared: SharedParts) -> PlacedShape:
        """What `write` wrote. Errors: KeyError, ValueError."""
        return PlacedShape(
            str(group.attrs["name"]),
            shared.read(str(group.attrs["shape"]), _read_shape),
            np.asarray(group.attrs["T_cam_shape"], dtype=np.float64),
            float(group.attrs["width"]),
            float(group.attrs["limit"]),
            np.asarray(group.attrs["covariance"], dtype=np.float64),
            bool(group.attrs.get("kin", False)),
            float(group.attrs["exact"]) if "exact" in group.attrs else None,
            np.asarray(group.attrs.get("alike", np.empty((0, 4, 4))), dtype=np.float64),
        )


def _write_shape(group: h5py.Group, shape: StoredShape) -> None:
    """Attributes lower (3) and spacing of the field; vertices (n, 3) float32, faces (m, 3) int32,
    colours (n, 3) uint8, field (nx, ny, nz) float16."""
    group.attrs.update({"lower": shape.field.lower, "spacing": shape.field.spacing})
    for key in ("vertices", "faces", "colours"):
        write_compressed(group, key, getattr(shape, key))
    write_compressed(group, "field", shape.field.values.astype(np.float16))


def _read_shape(group: h5py.Group) -> StoredShape:
    vertices = np.asarray(group["vertices"], dtype=np.float32)
    faces = np.asarray(group["faces"], dtype=np.int32)
    if not len(faces) or faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError("a mesh whose faces have corners that it lacks")
    field = DistanceField(
        np.asarray(group.attrs["lower"], dtype=np.float64),
        float(group.attrs["spacing"]),
        np.asarray(group["field"], dtype=np.float32),
    )
    return StoredShape(vertices, faces, np.asarray(group["colours"], dtype=np.uint8), field)
