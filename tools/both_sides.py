"""Pictures of reconstructed surfaces in their colours, from the camera's side and from behind."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from brrp_cli.reconstruction import Surface
from brrp_cli.rendering.render import PinholeView, fitted, render, view_from_behind
from brrp_cli.results.read import StoredResult

SAMPLES = 2  # rays of a pixel along each axis


def both_sides(
    result: StoredResult, surfaces: list[Surface], pixels: int
) -> list[NDArray[np.uint8]]:
    """Two pictures (pixels, pixels, 3), which the surfaces, in the frame of the result, fill."""
    vertices = np.concatenate([surface.vertices for surface in surfaces])
    centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    T_cam_frame = np.linalg.inv(result.T_frame_cam).astype(np.float64)
    # The normal of the table; without one, the image's upwards.
    up = -result.T_frame_cam[:3, 1] if result.plane is None else result.plane.normal
    size = pixels * SAMPLES
    K = np.array([[size, 0, size / 2], [0, size, size / 2], [0, 0, 1.0]])
    front = _towards(PinholeView(K, T_cam_frame, (size, size)), centre)
    views = (front, view_from_behind(front, centre, up))
    return [_drawn(surfaces, fitted(view, surfaces), pixels) for view in views]


def _towards(view: PinholeView, target: NDArray[np.floating]) -> PinholeView:
    """The view turned so that `target` (3,) lies in its middle: what lies at the image's border
    would be drawn askew."""
    seen = view.T_view_cam[:3, :3] @ target + view.T_view_cam[:3, 3]
    z = seen / np.linalg.norm(seen)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    T = np.eye(4)
    T[:3, :3] = np.stack([x, np.cross(z, x), z])
    return PinholeView(view.K, T @ view.T_view_cam, view.shape)


def _drawn(surfaces: list[Surface], view: PinholeView, pixels: int) -> NDArray[np.uint8]:
    """Smoothed at the edges."""
    colours = [surface.colours for surface in surfaces if surface.colours is not None]
    assert len(colours) == len(surfaces)
    fine = Image.fromarray(render(surfaces, colours, view))
    return np.asarray(fine.resize((pixels, pixels), Image.Resampling.BOX))
