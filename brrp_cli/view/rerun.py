"""The same in Rerun, for those who have its viewer open anyway."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from brrp_cli.dependencies import import_library
from brrp_cli.files import atomic_path
from brrp_cli.frames.frame import BACKGROUND
from brrp_cli.results.read import StoredResult
from brrp_cli.segmentation.mask_picture import object_colours
from brrp_cli.surface.colours import scale_top, spread, spread_colours
from brrp_cli.view.layers import collision_parts, observed_points


def show(stored: StoredResult, path: Path | None, title: str) -> None:
    """Open Rerun's viewer on the results, or write a recording (.rrd) where a path is given.

    Errors: DependencyError without rerun-sdk; OutputError.
    """
    rr: Any = import_library("rerun")
    recording = rr.RecordingStream(f"brrp_{title}", recording_id=title)
    if path is None:
        recording.spawn()
        log_result(rr, recording, stored)
        return
    with atomic_path(path) as partial:
        recording.save(str(partial))
        log_result(rr, recording, stored)
        recording.flush()
        recording.disconnect()


def log_result(rr: Any, recording: Any, stored: StoredResult) -> None:
    """Log camera, image, masks, points, meshes by uncertainty and collision shapes, all static.

    Entities stand below `/scene`, in the frame of the meshes, metres.
    """
    frame = stored.frame
    T = stored.T_frame_cam

    def log(entity: str, *what: Any) -> None:
        recording.log(entity, *what, static=True)

    log("scene/camera", rr.Transform3D(translation=T[:3, 3], mat3x3=T[:3, :3]))
    height, width = frame.shape
    log(
        "scene/camera/image",
        rr.Pinhole(image_from_camera=frame.K, width=width, height=height),
        rr.Image(frame.rgb),
    )
    colours = object_colours(frame.object_ids)
    place = {object_id: i + 1 for i, object_id in enumerate(frame.object_ids)}
    classes = [(i, f"object {key}", tuple(colours[key].tolist())) for key, i in place.items()]
    masks = np.zeros(frame.shape, dtype=np.uint16)
    for object_id, i in place.items():
        masks[frame.segmap == object_id] = i
    log("scene/camera/image/masks", rr.AnnotationContext(classes), rr.SegmentationImage(masks))
    for object_id in [BACKGROUND, *frame.object_ids]:
        points, seen = observed_points(stored, object_id)
        log(f"scene/points/{object_id}", rr.Points3D(points, colors=seen))
    top = scale_top(list(stored.surfaces.values()))
    for object_id, surface in stored.surfaces.items():
        log(
            f"scene/objects/{object_id}",
            rr.Mesh3D(
                vertex_positions=surface.vertices.astype(np.float32),
                triangle_indices=surface.faces.astype(np.uint32),
                vertex_normals=surface.as_trimesh().vertex_normals.astype(np.float32),
                vertex_colors=spread_colours(spread(surface), top),
            ),
        )
    for name, part in collision_parts(stored).items():
        log(
            f"scene/collision/{name}",
            rr.Mesh3D(
                vertex_positions=np.asarray(part.vertices, dtype=np.float32),
                triangle_indices=np.asarray(part.faces, dtype=np.uint32),
            ),
        )
