"""Ground truth of a scene: which object lies where, and its mesh.

A truth file is a list of {id, mesh_path, position [3], orientation [4, xyzw], scale}; a mesh's
world vertices are R(orientation) (scale v) + position. `mesh_path` is relative to a data folder
that the caller names, since data sets travel apart from their meshes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import SceneError
from brrp_cli.files import is_file, parse_json, trouble_of
from brrp_cli.geometry import similarity, transform_points
from brrp_cli.spoken import kind_of

# Folders in which the YCB archive keeps an object's meshes.
_INNER = ("google_16k", "google_64k", "google_512k", "tsdf", "poisson", "clouds")


@dataclass(frozen=True)
class TrueObject:
    """One object as it truly is.

    id : its value in the masks
    mesh_path : relative to the data root
    T_world_object : (4, 4) similarity, the mesh's coordinates to world metres
    unit : metres that one unit of the mesh file is
    known_as : what the prior calls it, where that is known
    """

    id: int
    mesh_path: str
    T_world_object: NDArray[np.float64]
    unit: float = 1.0
    known_as: str | None = None

    @property
    def name(self) -> str:
        """What the prior calls it; else NAME of NAME/google_16k/textured.obj (YCB's layout) and of
        NAME/textured.obj, else the file's name."""
        path = Path(self.mesh_path)
        if self.known_as is not None:
            return self.known_as
        if path.stem != "textured" or len(path.parts) < 2:
            return path.stem
        inner = path.parent.name in _INNER and len(path.parts) >= 3
        return path.parts[-3] if inner else path.parts[-2]


def read_objects(path: Path) -> list[TrueObject]:
    """The objects of an `objects.json` or `NAME.truth.json`.

    Errors: SceneError with the entry and the key that is missing or of the wrong kind.
    """
    try:
        entries = parse_json(path.read_bytes())
    except (OSError, ValueError) as error:
        raise SceneError(
            "Cannot read the true objects", where=path, found=trouble_of(error)
        ) from error
    if not isinstance(entries, list):
        raise SceneError(
            "Not a list of objects", where=path, expected="a list", found=kind_of(entries)
        )
    objects = [_read_object(entry, f"{path}, entry {i}") for i, entry in enumerate(entries)]
    ids = [o.id for o in objects]
    if len(set(ids)) < len(ids):
        raise SceneError(
            "Two objects have one id", where=path, expected="an id for each object", found=ids
        )
    return objects


def true_mesh(true_object: TrueObject, data_root: Path | None) -> Any:
    """The object's mesh as a trimesh.Trimesh in world metres; not closed where its file is open.

    Errors: SceneError if the data root or the mesh is missing, or if the mesh does not load.
    """
    import trimesh

    if data_root is None:
        raise SceneError(
            "The scenes' meshes are relative to a data folder that was not named",
            where=true_object.mesh_path,
            fix="pass --data-root DATA",
        )
    path = data_root / true_object.mesh_path
    if not is_file(path):
        raise SceneError(
            "An object's true mesh does not exist" if data_root.is_dir() else "No such data folder",
            where=path if data_root.is_dir() else data_root,
            fix=f"--data-root must name the folder below which {true_object.mesh_path} lies",
        )
    try:
        loaded: Any = trimesh.load(path, force="mesh", process=False, skip_materials=True)
        # Without texture coordinates, vertices that a seam repeats are one.
        mesh = trimesh.Trimesh(loaded.vertices, loaded.faces)
    except Exception as error:  # trimesh's readers raise whatever they like
        raise SceneError(
            "An object's true mesh does not load", where=path, found=trouble_of(error)
        ) from error
    if len(mesh.faces) == 0:
        raise SceneError("An object's true mesh has no faces", where=path)
    mesh.apply_scale(true_object.unit)
    mesh.apply_transform(true_object.T_world_object)
    return mesh


def true_mesh_in_camera(
    true_object: TrueObject, data_root: Path | None, T_world_cam: NDArray[np.float64]
) -> Any:
    """`true_mesh` in the camera frame of a view, where methods answer."""
    mesh = true_mesh(true_object, data_root)
    mesh.vertices = transform_points(np.linalg.inv(T_world_cam), mesh.vertices)
    return mesh


def _read_object(entry: Any, where: str) -> TrueObject:
    def fail(key: str, expected: str, found: object) -> SceneError:
        return SceneError(f"Bad true object: {key}", where=where, expected=expected, found=found)

    if not isinstance(entry, dict):
        raise fail("entry", "{id, mesh_path, position, orientation, scale}", entry)
    for key in ("id", "mesh_path", "position", "orientation", "scale"):
        if key not in entry:
            raise fail(f"no {key}", "id, mesh_path, position, orientation, scale", sorted(entry))
    object_id, mesh_path = entry["id"], entry["mesh_path"]
    if not isinstance(object_id, int) or isinstance(object_id, bool):
        raise fail("id", "an integer", object_id)
    if not isinstance(mesh_path, str):
        raise fail("mesh_path", "a path below the data root", mesh_path)
    position = _numbers(entry["position"])
    if position.shape != (3,):
        raise fail("position", "3 numbers, metres", entry["position"])
    orientation = _numbers(entry["orientation"])
    if orientation.shape != (4,) or not np.linalg.norm(orientation) > 0:
        raise fail("orientation", "a quaternion x y z w", entry["orientation"])
    # Simulators scale each axis; only one factor for all three is a similarity.
    scale = np.unique(_numbers(entry["scale"]))
    if scale.shape != (1,) or not scale[0] > 0:
        raise fail("scale", "one positive number", entry["scale"])
    return TrueObject(
        object_id, mesh_path, similarity(float(scale[0]), _rotation(orientation), position)
    )


def _rotation(xyzw: NDArray[np.float64]) -> NDArray[np.float64]:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(xyzw).as_matrix(), dtype=np.float64)


def _numbers(value: object) -> NDArray[np.float64]:
    """Finite numbers as an array; an empty array for anything else."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return np.empty(0)
    return array if np.isfinite(array).all() else np.empty(0)
