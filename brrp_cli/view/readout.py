"""What the page tells beside the picture, as plain JSON."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import transform_points
from brrp_cli.planning.body import body_axes
from brrp_cli.planning.scene import upwards
from brrp_cli.reconstruction import METRES
from brrp_cli.rendering.framing import shown_whole
from brrp_cli.results.read import StoredResult
from brrp_cli.segmentation.mask_picture import object_colours
from brrp_cli.surface.colours import scale_top, spread_colours, spread_meaning
from brrp_cli.view.layers import point_stride


def told(stored: StoredResult) -> dict[str, Any]:
    """The record of the results, a colour for each object, the colour scale and the camera."""
    record = stored.record
    colours = object_colours(stored.object_ids)
    keys = ("method", "retriever", "frame", "seed", "brrp")
    return {
        **{key: record[key] for key in keys},
        "preset": record["config"].get("preset"),
        "objects": [
            {**item, "colour": [int(c) for c in colours[item["id"]]]} for item in record["objects"]
        ],
        "scale": colour_scale(stored),
        "camera": camera(stored),
    }


def colour_scale(stored: StoredResult) -> dict[str, Any]:
    """`top` of the scale in the unit of the spread, `factor` to the unit that people read, and 256
    colours from 0 to the top."""
    surfaces = list(stored.surfaces.values())
    metres = any(surface.uncertainty_unit == METRES for surface in surfaces)
    ramp = spread_colours(np.linspace(0.0, 1.0, 256), 1.0)[:, :3]
    return {
        "top": scale_top(surfaces),
        "factor": 1000.0 if metres else 1.0,
        "unit": "mm" if metres else "",
        "meaning": spread_meaning(surfaces),
        "colours": ramp.ravel().tolist(),
    }


def camera(stored: StoredResult) -> dict[str, Any]:
    """The page's coordinates (y up, x the image's right, origin in the objects' middle) and what
    is seen in them.

    T_page_frame : (4, 4) row by row; position : (3,) metres, of the camera; radius : metres, of a
    ball around all objects but those that lie far from the others; point_size : metres between
    observed points
    """
    frame = stored.frame
    every = shown_points(stored)
    middle = (every.min(axis=0) + every.max(axis=0)) / 2
    right, away, up = body_axes(upwards(stored), stored.T_frame_cam[:3, 0]).T
    T_page_frame = np.eye(4)
    T_page_frame[:3, :3] = np.stack([right, up, -away])
    T_page_frame[:3, 3] = -T_page_frame[:3, :3] @ middle
    position = transform_points(T_page_frame, stored.T_frame_cam[:3, 3])
    spacing = float(np.linalg.norm(position)) / frame.K[0, 0] * point_stride(frame)
    return {
        "T_page_frame": T_page_frame.ravel().tolist(),
        "position": position.tolist(),
        "radius": float(np.linalg.norm(every - middle, axis=1).max()),
        "point_size": spacing,
    }


def shown_points(stored: StoredResult) -> NDArray[np.float64]:
    """(n, 3) vertices of the meshes that lie near the others, else all objects' points; metres,
    frame of the meshes."""
    vertices = [surface.vertices for surface in shown_whole(list(stored.surfaces.values()))]
    if not vertices:
        frame = stored.frame
        seen = [frame.object_points(i) for i in frame.object_ids]
        seen = [points for points in seen if len(points)] or [np.array([[0.0, 0.0, 1.0]])]
        vertices = [
            np.asarray(transform_points(stored.T_frame_cam, points), dtype=np.float64)
            for points in seen
        ]
    return np.vstack(vertices)
