"""One mesh file to one object of the prior."""

from __future__ import annotations

import dataclasses
import functools
from importlib.metadata import version

import numpy as np

from brrp_cli.errors import BrrpError, MeshError
from brrp_cli.geometry import similarity
from brrp_cli.prior.build.appearance import describe_appearance
from brrp_cli.prior.build.clouds import feature_clouds, spread
from brrp_cli.prior.build.coloured_mesh import PaintedMesh, load_painted, unpainted
from brrp_cli.prior.build.find_meshes import MeshSource
from brrp_cli.prior.build.load_mesh import load_mesh
from brrp_cli.prior.build.repair import repair
from brrp_cli.prior.build.resting_poses import resting_poses
from brrp_cli.prior.build.samples import draw_samples, surface_points
from brrp_cli.prior.build.stored_shape import stored_shape
from brrp_cli.prior.objects import PriorObject
from brrp_cli.prior.parameters import BuildParameters
from brrp_cli.seeds import child_rng
from brrp_cli.timing import timed

LIBRARIES = ("brrp-cli", "manifold3d", "numpy", "open3d", "pymeshlab", "scipy", "trimesh")


def make_object(
    source: MeshSource, parameters: BuildParameters, seconds: dict[str, float] | None = None
) -> PriorObject:
    """Load, repair, sample, describe geometrically. The description is left empty: the manifest
    holds it. Errors: MeshError, with the file in `where`.

    seconds : gets how long each stage took
    """
    seconds = {} if seconds is None else seconds
    # trimesh divides by the areas of slivers and of flat parts, and NumPy would tell of each.
    with np.errstate(divide="ignore", invalid="ignore"):
        with timed(seconds, "load"):
            original = load_mesh(source.path, parameters.units)
            painted, trouble = _painted(source, original.copy(), parameters)
        try:
            return _from_mesh(source.name, original, painted, trouble, parameters, seconds)
        except BrrpError as error:
            error.where = error.where or source.path
            raise


def _painted(  # type: ignore[no-untyped-def]
    source: MeshSource, original, parameters: BuildParameters
) -> tuple[PaintedMesh, str | None]:
    """The mesh with its colours; without them, and why, where they cannot be read."""
    try:
        return load_painted(source.path, parameters.units), None
    except MeshError as error:
        return unpainted(original), " ".join(str(error.found).split())


def _from_mesh(  # type: ignore[no-untyped-def]
    name: str,
    original,
    painted: PaintedMesh,
    trouble: str | None,
    parameters: BuildParameters,
    seconds: dict[str, float],
) -> PriorObject:
    # Far from the origin float32 has no digits left for the shape: work around the centre.
    offset = original.bounds.mean(axis=0)
    original.apply_translation(-offset)
    with timed(seconds, "repair"):
        repaired = repair(original, parameters.repair)
    mesh = repaired.mesh
    with timed(seconds, "poses"):
        poses = resting_poses(mesh, parameters.poses)
    with timed(seconds, "appearance"):
        appearance = describe_appearance(painted, mesh, poses, parameters.appearance)
    poses = [
        dataclasses.replace(pose, T_plane_object=_moved(pose.T_plane_object, -offset))
        for pose in poses
    ]
    center = mesh.bounds.mean(axis=0)
    extents = mesh.extents.copy()
    half_extent = float(extents.max() / 2)
    mesh.apply_translation(-center)
    mesh.apply_scale(1 / half_extent)
    seed = parameters.seed
    with timed(seconds, "samples"):
        samples, labels = draw_samples(
            mesh, parameters.samples, parameters.mix, child_rng(seed, name, "samples")
        )
    with timed(seconds, "surface"):
        dense, dense_normals = surface_points(
            mesh, parameters.dense_points, child_rng(seed, name, "surface")
        )
        surface, normals = spread(dense, dense_normals, parameters.surface_points)
    with timed(seconds, "features"):
        clouds = feature_clouds(dense, dense_normals, parameters.features)
    with timed(seconds, "mesh"):
        # Colours are in the frame of the file, metres.
        T_mesh_painted = similarity(1 / half_extent, translation=-(center + offset) / half_extent)
        shape = stored_shape(mesh, painted, T_mesh_painted, parameters.distances, parameters.mesh)
    return PriorObject(
        name=name,
        description="",
        center=center + offset,
        half_extent=half_extent,
        samples=samples,
        labels=labels,
        surface=surface.astype(np.float32),
        surface_normals=normals.astype(np.float32),
        clouds=clouds,
        poses=poses,
        record={
            "extents": extents.tolist(),
            "volume": float(mesh.volume * half_extent**3),
            "faces": {"original": len(original.faces), "repaired": len(mesh.faces)},
            "repair": repaired.record,
            "inside_share": float(labels.mean()),
            "poses": len(poses),
            "coloured": bool(appearance.colour.any()),
            **({"colours_unread": trouble} if trouble else {}),
            "made_with": {library: library_version(library) for library in LIBRARIES},
        },
        appearance=appearance,
        shape=shape,
    )


def _moved(T_plane_object: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """The transform for points that are first moved by `shift`."""
    T = T_plane_object.copy()
    T[:3, 3] += T[:3, :3] @ shift
    return T


@functools.cache
def library_version(name: str) -> str:
    """The installed version; brrp's own is that of the code that runs."""
    if name == "brrp-cli":
        from brrp_cli.version import __version__

        return __version__
    return version(name)
