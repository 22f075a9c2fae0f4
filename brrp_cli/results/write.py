"""The files of a reconstruction: meshes, one scene, the posterior, a record, a picture, and the
frame that it is of."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_open3d
from brrp_cli.errors import OutputError
from brrp_cli.files import atomic_folder, check_writable, refuse_folder
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.npz import save_frame
from brrp_cli.geometry import transform_points
from brrp_cli.reconstruction import (
    ObjectReconstruction,
    Reconstruction,
    Retrieved,
    Surface,
)
from brrp_cli.rendering.preview import preview
from brrp_cli.results.frame_digest import frame_digest
from brrp_cli.results.posterior_file import save_posteriors
from brrp_cli.spoken import either
from brrp_cli.surface.painting import surface_colours
from brrp_cli.version import __version__

if TYPE_CHECKING:
    import trimesh

SCHEMA = 1
RECORD = "result.json"
FRAME = "frame.npz"
SCENE = "scene.glb"
POSTERIOR = "posterior.h5"
PREVIEW = "preview.png"
# Metres; vertices are single precision, which has steps of a tenth of a millimetre there.
FARTHEST_ORIGIN = 1000.0
LIBRARIES = ("torch", "open3d", "numpy", "scipy", "scikit-image", "trimesh", "h5py", "onnxruntime")


def write_results(
    result: Reconstruction,
    folder: Path,
    *,
    frame: str = "camera",
    overwrite: bool = False,
    read: Frame | None = None,
    masks: Mapping[str, Any] | None = None,
) -> list[Path]:
    """Write everything into `folder`, whole or not at all; returns the paths of the files.

    Where no object has a surface there is no scene.glb: a scene of nothing cannot be exported.

    frame : "camera" or "world", the frame of the meshes (metres either way)
    read : the frame as it was read, before masks were made or mended, whose digest is recorded
    masks : what was asked for where masks were made on the way, as the record holds it

    Errors: OutputError if the folder exists and `overwrite` is false, if it cannot be written, or
    if "world" is asked of a frame without T_world_cam.
    """
    from PIL import Image

    T_target_cam = T_frame_cam(result.frame, frame)
    with atomic_folder(Path(folder), overwrite=overwrite, mark=RECORD) as partial:
        meshes = _meshes(result, T_target_cam)
        for object_id, mesh in meshes.items():
            mesh.export(partial / mesh_name(object_id))
        if meshes:
            _scene(meshes).export(partial / SCENE)
        posteriors = {o.object_id: o.posterior for o in result.objects if o.posterior is not None}
        save_posteriors(posteriors, partial / POSTERIOR)
        save_frame(result.frame, partial / FRAME)
        record = result_record(result, frame, read, masks)
        text = json.dumps(record, indent=2, allow_nan=False) + "\n"
        (partial / RECORD).write_text(text)
        caption = (
            f"retrieved by {result.retriever}" if result.retriever else f"{result.method}, no prior"
        )
        up = None if result.plane is None else result.plane.normal
        picture = preview(result.frame, result.objects, up=up, caption=caption)
        Image.fromarray(picture).save(partial / PREVIEW)
        names = sorted(path.name for path in partial.iterdir())
    return [Path(folder) / name for name in names]


def check_output(folder: Path, seen: Frame, frame: str, *, overwrite: bool) -> None:
    """Refuse early what `write_results` would refuse after the work is done."""
    refuse_folder(folder, overwrite=overwrite, mark=RECORD)
    T_frame_cam(seen, frame)
    check_writable(folder.parent)


def mesh_name(object_id: int) -> str:
    """File name of an object's mesh."""
    return f"object_{object_id}.ply"


def T_frame_cam(seen: Frame, frame: str) -> NDArray[np.float64]:
    """From the camera frame to the one in which meshes are written: "camera" or "world"."""
    if frame == "camera":
        return np.eye(4)
    if seen.T_world_cam is None:
        raise OutputError(
            "The frame does not say where the camera is in the world",
            where=seen.source,
            expected="the key T_world_cam, (4, 4)",
            fix=either(
                "name its pose with --camera-pose, or ask for --frame camera",
                "add it to the frame, or ask for frame='camera'",
            ),
        )
    distance = float(np.linalg.norm(seen.T_world_cam[:3, 3]))
    if distance > FARTHEST_ORIGIN:
        raise OutputError(
            "The world's origin is too far away for meshes in single precision",
            where=seen.source,
            expected=f"at most {FARTHEST_ORIGIN:g} m from the camera",
            found=f"{distance:g} m",
            fix="ask for --frame camera, or give T_world_cam with a nearer origin",
        )
    return seen.T_world_cam


def _meshes(
    result: Reconstruction, T_target_cam: NDArray[np.float64]
) -> dict[int, trimesh.Trimesh]:
    """Meshes by object id, in colour, with uncertainty as a scalar of each vertex."""
    import trimesh

    found = [(o.object_id, o.surface) for o in result.objects if o.surface is not None]
    return {
        object_id: trimesh.Trimesh(
            transform_points(T_target_cam, surface.vertices),
            surface.faces,
            vertex_colors=surface_colours(surface, result.frame, object_id),
            vertex_attributes={"uncertainty": surface.uncertainty.astype(np.float32)},
            process=False,
        )
        for object_id, surface in found
    }


def _scene(meshes: dict[int, trimesh.Trimesh]) -> trimesh.Scene:
    """All meshes in one scene, in colour; GLB viewers choke on unknown vertex attributes."""
    import trimesh

    scene = trimesh.Scene()
    for object_id, mesh in meshes.items():
        plain = mesh.copy()
        plain.vertex_attributes.clear()
        name = f"object_{object_id}"
        scene.add_geometry(plain, node_name=name, geom_name=name)
    return scene


def result_record(
    result: Reconstruction,
    frame: str,
    read: Frame | None = None,
    masks: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """result.json: what was found, and all that it takes to find it again. The arguments are those
    of `write_results`."""
    source = result.frame.source
    T_target_cam = T_frame_cam(result.frame, frame)
    return {
        "schema": SCHEMA,
        "brrp": __version__,
        "source": None if source is None else str(source),
        "source_sha256": None if read is None else frame_digest(read),
        "frame": frame,
        "units": "metre",
        "T_frame_cam": T_target_cam.tolist(),
        "method": result.method,
        "retriever": result.retriever,
        "prior": None
        if result.prior_path is None
        else {"path": str(result.prior_path), "digest": result.prior_digest},
        "seed": result.seed,
        "device": result.device,
        "plane_cam": None
        if result.plane is None
        else {"normal": result.plane.normal.tolist(), "offset": result.plane.offset},
        "objects": [_object_record(o, T_target_cam) for o in result.objects],
        "seconds": _rounded(result.seconds),
        "config": result.configuration,
        "segmentation": result.segmentation,
        "masks": None if masks is None else dict(masks),
        "versions": _versions(),
    }


def _object_record(item: ObjectReconstruction, T_target_cam: NDArray[np.float64]) -> dict[str, Any]:
    return {
        "id": item.object_id,
        "status": item.status,
        "message": item.message,
        "points": item.n_points,
        "mesh": None if item.surface is None else mesh_name(item.object_id),
        **({} if item.surface is None else _surface_record(item.surface, T_target_cam)),
        "recognised": None if item.recognised is None else item.recognised.name,
        "like": None if item.like is None else item.like.name,
        "similar": [asdict(each) for each in item.similar],
        "not_in_prior": item.unknown_probability,
        "weight_not_in_prior": item.unknown_weight,
        "retrieved": [_retrieved_record(r, T_target_cam) for r in item.retrieved],
        "seconds": _rounded(item.seconds),
    }


def _surface_record(surface: Surface, T_target_cam: NDArray[np.float64]) -> dict[str, Any]:
    """Axis-aligned box in the frame of the meshes, metres; volume in litres; the smallest box."""
    vertices = transform_points(T_target_cam, surface.vertices)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return {
        "center": ((low + high) / 2).tolist(),
        "extents": (high - low).tolist(),
        "oriented_box": _oriented_box(vertices),
        "volume_litre": float(surface.as_trimesh().volume * 1000),
        "mean_uncertainty": float(surface.uncertainty.mean()),
        "uncertainty_unit": surface.uncertainty_unit,
    }


def _oriented_box(vertices: NDArray[np.floating]) -> dict[str, Any]:
    """The smallest box around (n, 3) vertices that Open3D finds: its rigid pose, from its axes to
    the frame of the vertices, and its extents along these axes, longest first, metres."""
    o3d = import_open3d()
    points = o3d.utility.Vector3dVector(np.ascontiguousarray(vertices, np.float64))
    # `robust` for what is flat.
    box = o3d.geometry.OrientedBoundingBox.create_from_points_minimal(points, robust=True)
    order = np.argsort(-np.asarray(box.extent), kind="stable")
    axes = np.asarray(box.R)[:, order]
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    T_frame_box = np.eye(4)
    T_frame_box[:3, :3], T_frame_box[:3, 3] = axes, box.center
    return {"T_frame_box": T_frame_box.tolist(), "extents": np.asarray(box.extent)[order].tolist()}


def _retrieved_record(found: Retrieved, T_target_cam: NDArray[np.float64]) -> dict[str, Any]:
    """Poses `T_...` are rigid, from the mesh file times `size_factor`, metres."""
    placed = found.T_cam_mesh
    return {
        "name": found.name,
        "probability": found.probability,
        "size_factor": found.size_factor,
        "inliers": found.inliers,
        "fitness": found.fitness,
        "alignment_score": found.alignment_score,
        "weight": found.weight,
        "T_cam_mesh": None if placed is None else placed.tolist(),
        "T_frame_mesh": None if placed is None else (T_target_cam @ placed).tolist(),
        "alike_T_cam_mesh": [each.tolist() for each in found.alike],
    }


def _rounded(seconds: dict[str, float]) -> dict[str, float]:
    return {stage: round(value, 4) for stage, value in seconds.items()}


def _versions() -> dict[str, str | None]:
    found: dict[str, str | None] = {}
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = None
    return found
