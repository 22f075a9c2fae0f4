"""The surface inside which an object lies with a given probability.

A posterior tells for each point how probably it is occupied. Of the whole shape O it says this:
particle i is drawn with probability 1 / P, a level u uniformly from (0, 1), and

    O = {x : p_i(x) > u}.

So every point is occupied with the posterior's p(x) = mean_i p_i(x). Within a particle the surface
lies further out or further in as a whole; from particle to particle it differs as they differ. The
region that is sought is the smallest of

    C_t = {x : p(x) >= t}    with    P(O in C_t) = 1 - mean_i sup {p_i(x) : p(x) < t} >= confidence,

a statement about all of O at once. It is never smaller than {p >= 1 - confidence}, which holds for
each point alone, and is the same where there is one particle. Nested level sets of p as candidates
and a joint probability to choose among them: Bolin and Lindgren, "Excursion and contour uncertainty
regions for latent Gaussian models", JRSS B 77 (2015), section 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SurfaceConfig
from brrp_cli.inference.particles import particle_volumes
from brrp_cli.methods.base import OccupancyPosterior
from brrp_cli.surface.extract import lattice_axes, level_set


@dataclass(frozen=True)
class ConfidenceSurface:
    """A closed, outward mesh that the object lies inside of with probability `confidence`.

    vertices : (n, 3) float64, metres, camera frame; faces : (m, 3) int64
    level : t, the occupancy probability on it
    bounded : false where the region reaches the end of what the posterior describes, so that
    the object may go on beyond it
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    confidence: float
    level: float
    bounded: bool


def confidence_level(volumes: NDArray[np.floating], confidence: float) -> float | None:
    """The largest t at which P(O in C_t) >= confidence; None where even "O is empty" is that
    probable.

    volumes : (P, ...) occupancy of each particle at the points of a lattice; confidence : in (0, 1)
    """
    particles = volumes.reshape(len(volumes), -1)
    mean = particles.mean(axis=0)
    order = np.argsort(mean, kind="stable")
    # P(O not in C) when the first k points are outside of C.
    missed = np.maximum.accumulate(particles[:, order], axis=1).mean(axis=0)
    left_out = int(np.searchsorted(missed, 1 - confidence, side="right"))
    return None if left_out == len(mean) else float(mean[order[left_out]])


def confidence_surface(
    posterior: OccupancyPosterior,
    observed: NDArray[np.floating],
    confidence: float,
    config: SurfaceConfig,
) -> ConfidenceSurface | None:
    """The boundary of the smallest C_t that holds the object with probability `confidence`.

    observed : (n, 3) points of the object, metres, camera frame. As with the mesh, parts that no
    observed point is near are dropped. None where nothing is left.
    """
    axes = lattice_axes(posterior.bounds, config.spacing)
    volumes = particle_volumes(posterior, axes)
    level = confidence_level(volumes, confidence)
    if level is None:
        return None
    found = level_set(volumes.mean(axis=0), axes, observed, level, config)
    if found is None:
        return None
    edge = np.array([[axis[0] for axis in axes], [axis[-1] for axis in axes]])
    inside = (found.vertices > edge[0]) & (found.vertices < edge[1])
    return ConfidenceSurface(
        found.vertices, found.faces, confidence, level, bounded=bool(inside.all())
    )
