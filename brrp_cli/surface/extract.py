"""From a posterior to a closed mesh with uncertainty on its vertices."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SurfaceConfig
from brrp_cli.errors import BrrpError
from brrp_cli.finite import check_finite
from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior
from brrp_cli.reconstruction import Axes, OccupancyPosterior, Surface
from brrp_cli.surface.connect import near_observed, one_piece
from brrp_cli.surface.guessed import with_guesses
from brrp_cli.surface.stored_mesh import along_normals, moved_to_level, placed, spread_of_all

# How far, at least, the occupancy of what is inside lies above the level: 10 micrometres.
_CLEAR = 1e-3
MAX_NODES = 2**24


def grid_axes(bounds: NDArray[np.floating], spacing: float) -> Axes:
    """Coordinates along x, y and z of a grid that fills a box (2, 3), metres."""
    x, y, z = (np.arange(low, high + spacing / 2, spacing) for low, high in bounds.T)
    return x, y, z


def extract_surface(
    posterior: OccupancyPosterior, observed: NDArray[np.floating], config: SurfaceConfig
) -> Surface | None:
    """The surface where the mean occupancy is `config.level`.

    The stored mesh, moved there, where a placed shape explains the object; marching cubes
    elsewhere, and where the frame contradicts the shape by more than its mesh can be moved.

    observed : (n, 3) points of the object, metres, camera frame. Parts of the level set that no
    observed point is near are dropped: where neither rays nor prior samples reach, the map keeps
    the noise that the particles started from. Returns None when nothing is left. Errors: BrrpError
    if the posterior is not finite, or wider than any object.
    """
    if isinstance(posterior, HypothesisPosterior) and posterior.dominant is not None:
        explained = placed(posterior, posterior.dominant)
        through = along_normals(posterior, posterior.dominant, config)
        # Other placements of the object, its handle elsewhere, say how sure this one is; a surface
        # between them would be that of nothing.
        moved = moved_to_level(through, config.level, through.own, stay=explained.kin)
        deviation = moved_to_level(through, config.level).deviation
        # Between placements that are apart occupancy hardly falls, however near they are.
        together = spread_of_all(through, moved.deviation, explained.width)
        deviation = np.minimum(deviation, together).astype(np.float32)
        if explained.kin:
            # Walls of several kin that miss each other have no surface in common.
            most = np.hypot(moved.deviation, 2 * config.farthest).astype(np.float32)
            deviation = np.minimum(deviation, most)
            deviation = with_guesses(deviation, moved.vertices, observed, posterior, config.guessed)
        check_finite("The surface", vertices=moved.vertices, uncertainty=deviation)
        # Kin are off by more; a grid would lose their walls, and what they are taken for.
        if explained.kin or moved.off <= config.most_off:
            return Surface(
                moved.vertices,
                explained.shape.faces.astype(np.int64),
                deviation,
                posterior.surface_unit,
                # What is only like a stored object has the colours of the image.
                None if explained.kin else explained.shape.colours,
            )
    spacing = grid_spacing(posterior.bounds, config)
    axes = grid_axes(posterior.bounds, spacing)
    volume = posterior.probability_volume(axes)
    check_finite("The posterior", occupancy=volume)
    found = level_set(volume, axes, observed, config.level, config)
    if found is None and isinstance(posterior, HypothesisPosterior):
        # Hypotheses that disagree may leave no place that is the object's more probably than not.
        # It lies somewhere: the heaviest of them is the best guess.
        volume = posterior.heaviest().probability_volume(axes)
        found = level_set(volume, axes, observed, config.level, config)
    if found is None:
        return None
    uncertainty = posterior.surface_uncertainty(found.vertices)
    if isinstance(posterior, HypothesisPosterior):
        uncertainty = with_guesses(uncertainty, found.vertices, observed, posterior, config.guessed)
    check_finite("The surface", vertices=found.vertices, uncertainty=uncertainty)
    return Surface(found.vertices, found.faces, uncertainty, posterior.surface_unit)


class LevelSet(NamedTuple):
    """A closed, outward mesh: vertices (n, 3) float64, metres, camera frame; faces (m, 3) int64."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]


def grid_spacing(bounds: NDArray[np.floating], config: SurfaceConfig) -> float:
    """Metres between nodes: about `config.nodes` nodes in the box (2, 3), within the limits."""
    size = np.asarray(bounds[1] - bounds[0], dtype=np.float64)
    spacing = float((np.prod(size) / config.nodes) ** (1 / 3))
    spacing = float(np.clip(spacing, config.finest, config.spacing))
    _check_size(size, spacing)
    return spacing


def level_set(
    volume: NDArray[np.floating],
    axes: Axes,
    observed: NDArray[np.floating],
    level: float,
    config: SurfaceConfig,
) -> LevelSet | None:
    """Marching cubes at `level` on occupancy (nx, ny, nz) at the nodes of `axes`, metres, camera
    frame: the parts near the points `observed` (n, 3), as one piece where the configuration asks
    for it (connect.py). None if nothing is left.
    """
    from skimage.measure import marching_cubes

    origin = np.array([axis[0] for axis in axes])
    spacing = float(axes[0][1] - axes[0][0])
    kept = own_part(volume, axes, observed, level, config)
    if not kept.any():
        return None
    # What was dropped must not leave a surface; a border of zeros closes what touches the bounds.
    volume = np.where((volume >= level) & ~kept, 0.0, volume)
    # A node on the level itself is a surface without volume, or none at all.
    volume = np.where(kept, np.maximum(volume, level + _CLEAR), volume)
    volume = np.pad(volume, 1)
    vertices, faces, _, _ = marching_cubes(volume, level, gradient_direction="ascent")
    vertices = (vertices.astype(np.float64) - 1) * spacing + origin
    return LevelSet(vertices, faces.astype(np.int64))


def own_part(
    volume: NDArray[np.floating],
    axes: Axes,
    observed: NDArray[np.floating],
    level: float,
    config: SurfaceConfig,
) -> NDArray[np.bool_]:
    """Nodes (nx, ny, nz) at `level` or above that `level_set` keeps; none is True where nothing is
    left."""
    origin = np.array([axis[0] for axis in axes])
    spacing = float(axes[0][1] - axes[0][0])
    seen = (observed - origin) / spacing
    if config.one_piece:
        return one_piece(volume, level, seen, spacing, config)
    return near_observed(volume >= level, seen, config.keep_distance / spacing)


def _check_size(size: NDArray[np.float64], spacing: float) -> None:
    """BrrpError where a grid would hold more nodes than memory: one stray pixel of a mask on a
    far wall makes an object metres wide."""
    if not np.prod(size / spacing + 1) <= MAX_NODES:
        raise BrrpError(
            "The object is too wide for a surface",
            expected=f"up to about {MAX_NODES ** (1 / 3) * spacing:.1f} m in each direction",
            found=" x ".join(f"{side:.2f}" for side in size) + " m",
            fix="take pixels of what lies behind it out of its mask",
        )
