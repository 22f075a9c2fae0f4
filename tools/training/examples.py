"""Labelled examples to train on, made from scenes once and kept as HDF5.

One file for each scene, SET_NAME.h5, written whole or not at all, so that what was interrupted goes
on:

    /           schema, recipe (JSON: what decides the numbers)
    clouds      (N, P, 3) float16, farthest-point order, centred and in units of `scale`
    queries     (N, Q, 3) float16, in the same frame and unit
    labels      (N, Q) bool, occupied
    names       (N,) the true object's name

An example is one object in one view. The frame is the camera's, moved to the middle of the bounding
box of what was seen of the object, as at run time.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import BrrpError
from brrp_cli.files import atomic_path
from brrp_cli.ground_truth.scenes import Scene
from brrp_cli.ground_truth.true_meshes import close_truth, exact_truth
from brrp_cli.ground_truth.truth import TrueObject
from brrp_cli.methods.pointsdf.farthest_points import farthest_points
from brrp_cli.observation.ray_samples import box_center
from brrp_cli.raycast import Solid
from brrp_cli.seeds import child_rng
from training.queries import draw_queries

SCHEMA = 1
TRUTHS = ("closed", "exact")


@dataclass(frozen=True)
class Recipe:
    """What decides the examples of a scene.

    truth : the mesh that labels: "closed" as the published tables close it, or "exact"
    points : of a cloud; queries : of an example; scale : metres a unit
    min_pixels : objects with fewer pixels that have depth are left out
    """

    truth: str = "closed"
    points: int = 256
    queries: int = 2048
    scale: float = 0.15
    min_pixels: int = 64
    seed: int = 0


@dataclass(frozen=True)
class Examples:
    """Clouds (N, P, 3) and queries (N, Q, 3) float16, labels (N, Q) bool, names of N objects."""

    clouds: NDArray[np.float16]
    queries: NDArray[np.float16]
    labels: NDArray[np.bool_]
    names: list[str]

    def __len__(self) -> int:
        return len(self.clouds)


def make_examples(
    scenes: Sequence[Scene], data_root: Path, recipe: Recipe, folder: Path, cache: Path
) -> Iterator[Path]:
    """Write what is missing of the scenes' examples into `folder`; yields each scene's file.

    cache : of closed meshes. Errors: BrrpError if a file there was made in another way; SceneError
    or MeshError for a scene that cannot be used.
    """
    for scene in scenes:
        path = folder / f"{scene.folder.parent.name}_{scene.name}.h5"
        if path.exists():
            _read_recipe(path, recipe)
        else:
            _write(scene_examples(scene, data_root, recipe, cache), recipe, path)
        yield path


def scene_examples(scene: Scene, data_root: Path, recipe: Recipe, cache: Path) -> Examples:
    """The examples of all views of one scene. The same scene and recipe give the same numbers."""
    frames = [scene.view(index) for index in range(len(scene.views))]
    clouds, queries, labels, names = [], [], [], []
    for true_object in scene.objects:
        for index, frame in enumerate(frames):
            points = frame.object_points(true_object.id)
            if len(points) < recipe.min_pixels:
                continue
            assert frame.T_world_cam is not None
            center = box_center(points)
            T_query_world = np.linalg.inv(frame.T_world_cam)
            T_query_world[:3, 3] -= center
            drawn, occupied = draw_queries(
                _solid(true_object.mesh_path, data_root, recipe.truth, cache),
                T_query_world @ true_object.T_world_object,
                recipe.queries,
                recipe.scale,
                child_rng(recipe.seed, "queries", scene.name, index, true_object.id),
            )
            cloud = farthest_points(points - center, recipe.points)
            clouds.append((cloud / recipe.scale).astype(np.float16))
            queries.append(drawn)
            labels.append(occupied)
            names.append(true_object.name)
    return Examples(
        np.array(clouds, dtype=np.float16).reshape(-1, recipe.points, 3),
        np.array(queries, dtype=np.float16).reshape(-1, recipe.queries, 3),
        np.array(labels, dtype=bool).reshape(-1, recipe.queries),
        names,
    )


# Open3D ends the process where more than a thousand scenes are kept.
@lru_cache(maxsize=256)
def _solid(mesh_path: str, data_root: Path, truth: str, cache: Path) -> Solid:
    """The closed mesh that labels, in its file's coordinates."""
    item = TrueObject(0, mesh_path, np.eye(4))
    if truth == "closed":
        return Solid(close_truth(item, data_root, cache).for_iou)
    return Solid(exact_truth(item, data_root, cache).mesh)


def read_examples(paths: Sequence[Path], recipe: Recipe) -> Examples:
    """The examples of several files, one after the other.

    Errors: BrrpError for a file that is damaged or was made in another way.
    """
    import h5py

    parts = []
    for path in paths:
        _read_recipe(path, recipe)
        try:
            with h5py.File(path, "r") as file:
                clouds, queries, labels = (file[n][()] for n in ("clouds", "queries", "labels"))
                names = [name.decode() for name in file["names"][()]]
        except (OSError, KeyError) as error:
            raise _unreadable(path, error) from error
        parts.append(Examples(clouds, queries, labels, names))
    return Examples(
        np.concatenate([part.clouds for part in parts]),
        np.concatenate([part.queries for part in parts]),
        np.concatenate([part.labels for part in parts]),
        [name for part in parts for name in part.names],
    )


def _write(examples: Examples, recipe: Recipe, path: Path) -> None:
    import h5py

    with atomic_path(path) as partial, h5py.File(partial, "w") as file:
        file.attrs["schema"] = SCHEMA
        file.attrs["recipe"] = json.dumps(asdict(recipe))
        for name in ("clouds", "queries", "labels"):
            data = getattr(examples, name)
            # One example a chunk; without examples there is nothing to cut into chunks.
            options: dict[str, Any] = {"chunks": (1, *data.shape[1:])} if len(data) else {}
            file.create_dataset(name, data=data, fletcher32=bool(len(data)), **options)
        file.create_dataset("names", data=examples.names, dtype=h5py.string_dtype())


def _read_recipe(path: Path, recipe: Recipe) -> None:
    """BrrpError unless the file's examples were made as `recipe` says."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            schema, found = file.attrs["schema"], json.loads(file.attrs["recipe"])
    except (OSError, KeyError, ValueError) as error:
        raise _unreadable(path, error) from error
    wanted = asdict(recipe)
    if schema != SCHEMA or found != wanted:
        raise BrrpError(
            "The examples were made in another way",
            where=path,
            expected=wanted,
            found=f"schema {schema}, {found}",
            fix="write into another folder, or delete this one",
        )


def _unreadable(path: Path, error: Exception) -> BrrpError:
    return BrrpError(
        "A file of examples cannot be read",
        where=path,
        found=error,
        fix="delete it: it will be made again",
    )
