"""The folder of a plan: meshes, URDF, MJCF, a cuRobo world, MoveIt's scene, one GLB, a record."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.planning import RestConfig, TableBoxConfig
from brrp_cli.errors import ResultError
from brrp_cli.files import atomic_folder
from brrp_cli.planning.body import Body
from brrp_cli.planning.curobo import curobo_world
from brrp_cli.planning.mjcf import (
    FURNITURE_COLOUR,
    Files,
    TableBox,
    body_mjcf,
    scene_mjcf,
    solid_name,
)
from brrp_cli.planning.moveit import planning_scene, scene_text
from brrp_cli.planning.moveit_grasps import grasp_frames, grasp_messages, stored_grasps
from brrp_cli.planning.options import PlanOptions
from brrp_cli.planning.rest import Rest, put_to_rest
from brrp_cli.planning.scene import (
    PlannedObject,
    furniture_around,
    planned_objects,
    table_under,
    upwards,
)
from brrp_cli.planning.urdf import urdf
from brrp_cli.raycast import raycasting_scene
from brrp_cli.results.read import StoredResult
from brrp_cli.segmentation.mask_picture import PALETTE
from brrp_cli.version import __version__

if TYPE_CHECKING:
    import trimesh

SCHEMA = 1
RECORD = "plan.json"
WORLD, SCENE, GLB = "world.yml", "scene.xml", "scene.glb"
MOVEIT, MOVEIT_SCENE, MOVEIT_GRASPS = "moveit.scene", "moveit.json", "moveit_grasps.json"
TABLE_COLOUR = (180, 168, 150, 255)


def write_plan(
    stored: StoredResult,
    folder: Path,
    options: PlanOptions,
    *,
    overwrite: bool = False,
    planned: Iterable[PlannedObject] | None = None,
) -> dict[str, Any]:
    """Write the collision shapes of all objects that have a mesh, whole or not at all; returns the
    record.

    planned : `planned_objects(stored, options)` unless given, so that a caller can watch
    Errors: ResultError if no object has a mesh; those of `planned_objects`; OutputError.
    """
    if not stored.surfaces:
        raise ResultError(
            "No object of the results has a mesh",
            where=stored.folder,
            fix="result.json says why; look at the masks with `brrp view`",
        )
    with atomic_folder(folder, overwrite=overwrite, mark=RECORD) as partial:
        objects = list(planned_objects(stored, options) if planned is None else planned)
        bodies = {each.body.name: each.body for each in objects}
        table = table_under(
            list(bodies.values()), stored.plane, TableBoxConfig(), furniture_around(stored)
        )
        config, resting = RestConfig(), {}
        if options.rests and table is not None:
            resting = put_to_rest(bodies, table, config)
            bodies = {n: replace(body, parts=resting[n].parts) for n, body in bodies.items()}
        poses = {name: rest.T_frame_body for name, rest in resting.items()} or None
        files = {name: _write_meshes(body, partial, options) for name, body in bodies.items()}
        for name, body in bodies.items():
            (partial / f"{name}.urdf").write_text(urdf(body, files[name], config))
            (partial / f"{name}.xml").write_text(body_mjcf(body, files[name], config))
        (partial / SCENE).write_text(scene_mjcf(bodies, files, table, config, poses))
        (partial / WORLD).write_text(curobo_world(bodies, table, stored.record["frame"]))
        if options.moveit is not None:
            _write_moveit(stored, partial, bodies, table, options.moveit)
        _glb(bodies, table).export(partial / GLB)
        record = _record(stored, options, objects, files, table, resting, config)
        (partial / RECORD).write_text(json.dumps(record, indent=2) + "\n")
    return record


def _write_meshes(body: Body, folder: Path, options: PlanOptions) -> Files:
    """OBJ, which PyBullet, MuJoCo and ROS all read."""
    import trimesh

    (folder / "meshes").mkdir(exist_ok=True)
    names = Files(
        mesh=f"meshes/{body.name}.obj",
        parts=[f"meshes/{body.name}_part_{i}.obj" for i in range(len(body.parts))],
    )
    _save(body.mesh, folder / names.mesh)
    for part, name in zip(body.parts, names.parts, strict=True):
        _save(trimesh.convex.convex_hull(part), folder / name)
    if options.confidence is not None:
        _save(body.collision, folder / "meshes" / f"{body.name}_inside.obj")
    return names


def _write_moveit(
    stored: StoredResult,
    folder: Path,
    bodies: dict[str, Body],
    table: TableBox | None,
    frame_id: str,
) -> None:
    """Its text file and its message, and the grasps of the results where there are any. Errors:
    ResultError for a grasps.json that cannot be read."""
    frame_id = frame_id or str(stored.record["frame"])
    found = stored_grasps(stored.folder)
    frames = grasp_frames(found)
    (folder / MOVEIT).write_text(scene_text(bodies, table, frames))
    message = planning_scene(bodies, table, frames, frame_id)
    (folder / MOVEIT_SCENE).write_text(json.dumps(message) + "\n")
    if found:
        messages = grasp_messages(found, upwards(stored), frame_id)
        (folder / MOVEIT_GRASPS).write_text(json.dumps(messages, indent=1) + "\n")


def _save(mesh: trimesh.Trimesh, path: Path) -> None:
    import trimesh

    bare = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    path.write_text(trimesh.exchange.obj.export_obj(bare, include_normals=False, header=None))


def _glb(bodies: dict[str, Body], table: TableBox | None) -> trimesh.Scene:
    """All convex parts, each in a colour, and the table, in the frame of the results."""
    import trimesh

    scene = trimesh.Scene()
    for name, body in bodies.items():
        for i, part in enumerate(body.parts):
            hull = trimesh.convex.convex_hull(part).apply_transform(body.T_frame_body)
            hull.visual.face_colors = [*PALETTE[i % len(PALETTE)], 255]
            part_name = f"{name}_part_{i}"
            scene.add_geometry(hull, node_name=part_name, geom_name=part_name)
    if table is not None:
        top = trimesh.creation.box(table.size, table.T_frame_table)
        top.visual.face_colors = TABLE_COLOUR
        scene.add_geometry(top, node_name="table", geom_name="table")
        for name, walls in table.furniture.items():
            for i, wall in enumerate(walls):
                hull = trimesh.convex.convex_hull(wall)
                hull.visual.face_colors = [*(round(255 * c) for c in FURNITURE_COLOUR), 255]
                own = solid_name(name, i)
                scene.add_geometry(hull, node_name=own, geom_name=own)
    return scene


def _record(
    stored: StoredResult,
    options: PlanOptions,
    objects: list[PlannedObject],
    files: dict[str, Files],
    table: TableBox | None,
    resting: dict[str, Rest],
    config: RestConfig,
) -> dict[str, Any]:
    meshed = [each.object_id for each in objects]
    return {
        "schema": SCHEMA,
        "brrp": __version__,
        "results": str(stored.folder),
        "frame": stored.record["frame"],
        "units": {"length": "metre", "mass": "kilogram", "inertia": "kg m^2"},
        "collision": options.collision,
        "confidence": options.confidence,
        "margin": options.margin,
        "density": options.density,
        "seed": options.seed,
        "rest": asdict(config) if resting else None,
        "up": upwards(stored).tolist(),
        "table": None
        if table is None
        else {
            "T_frame_table": table.T_frame_table.tolist(),
            "size": table.size.tolist(),
            "bins": [
                {"name": name, "walls": [wall.tolist() for wall in walls]}
                for name, walls in table.bins.items()
            ],
            "platforms": [
                {"name": name, "corners": solid.tolist()}
                for name, (solid,) in table.platforms.items()
            ],
            "walls": [
                {"name": name, "corners": wall.tolist()} for name, (wall,) in table.walls.items()
            ],
        },
        "objects": [
            _object_record(each, files[each.body.name], resting.get(each.body.name))
            for each in objects
        ],
        "left_out": [
            {"id": item["id"], "why": item["message"] or item["status"]}
            for item in stored.record["objects"]
            if item["id"] not in meshed
        ],
    }


def _object_record(each: PlannedObject, files: Files, rest: Rest | None) -> dict[str, Any]:
    body, region = each.body, each.region
    record: dict[str, Any] = {
        "id": each.object_id,
        "name": body.name,
        "T_frame_body": body.T_frame_body.tolist(),
        "mass": body.mass,
        "inertia": body.inertia.tolist(),
        "volume_litre": float(body.mesh.volume * 1000),
        "collision_volume_litre": float(body.collision.volume * 1000),
        "urdf": f"{body.name}.urdf",
        "mjcf": f"{body.name}.xml",
        "mesh": files.mesh,
        "parts": list(files.parts),
        "rest": None
        if rest is None
        else {
            "T_frame_body": rest.T_frame_body.tolist(),
            "moved_mm": 1000 * rest.moved,
            "turned_degrees": rest.turned,
            "foot_mm": 1000 * rest.foot,
            "plate": rest.plate,
            "left_alone": {
                "moved_mm": 1000 * rest.left_moved,
                "turned_degrees": rest.left_turned,
            },
        },
    }
    if region is not None:
        margin = margins(body)
        record |= {
            "level": region.level,
            "bounded": region.bounded,
            "margin_mean": float(margin.mean()),
            "margin_max": float(margin.max()),
        }
    return record


def margins(body: Body) -> NDArray[np.float32]:
    """How far (n,), metres, the vertices of the collision shape lie from the mesh."""
    from brrp_cli.dependencies import import_open3d

    o3d = import_open3d()
    query = o3d.core.Tensor(np.asarray(body.collision.vertices, dtype=np.float32))
    return np.asarray(raycasting_scene([body.mesh]).compute_distance(query).numpy())
