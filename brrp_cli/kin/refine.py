"""Few damped Gauss-Newton steps that bring many stretched shapes onto what was seen, out of what
was seen to be free, and back to their own proportions where nothing speaks against it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import KinConfig
from brrp_cli.kin.evidence import Evidence
from brrp_cli.kin.library import Library
from brrp_cli.kin.placement import KinPlacements, distance_and_slopes
from brrp_cli.kin.unknowns import LEAST_WEIGHT, UNKNOWNS, limited, size_prior

Floats = NDArray[np.float32]
Array = NDArray[np.float64]


def refined(
    placements: KinPlacements, evidence: Evidence, library: Library, config: KinConfig
) -> KinPlacements:
    """Each placement after `config.steps` steps over turn, middle, the three scales and taper."""
    seen, free = evidence.seen[: config.step_seen], evidence.free[: config.step_free]
    points = np.concatenate([seen, free])
    for _ in range(config.steps):
        distance, u, slope, across = distance_and_slopes(placements, points, library)
        rows = _jacobian(placements, u, slope, across)
        weight = _weights(distance, len(seen), config)
        residual = distance.astype(np.float64)
        # A point of free space asks the surface to be no nearer than its own side of it.
        residual[:, len(seen) :] = np.minimum(residual[:, len(seen) :], 0)
        by_fit = rows.transpose(1, 0, 2)
        H = (by_fit * weight[:, None]) @ by_fit.transpose(0, 2, 1)
        g = (by_fit @ (weight * residual)[..., None])[..., 0]
        _, prior_H, prior_g = size_prior(
            placements.half,
            library.half[placements.stance],
            placements.middle[:, 2],
            placements.taper,
            config,
        )
        H += prior_H
        g += prior_g
        diagonal = H[:, range(UNKNOWNS), range(UNKNOWNS)]
        H[:, range(UNKNOWNS), range(UNKNOWNS)] = diagonal * (1 + config.damping) + LEAST_WEIGHT
        step = -np.asarray(np.linalg.solve(H, g[..., None])[..., 0], dtype=np.float64)
        placements = _moved(placements, step, config)
    return placements


def _jacobian(placements: KinPlacements, u: Floats, slope: Floats, across: Floats) -> Array:
    """Rows (8, B, n): of the distance along each unknown."""
    c, s = np.cos(placements.turn)[:, None], np.sin(placements.turn)[:, None]
    half = placements.half.T[:, :, None]
    wide = placements.widened(u[2])
    x, y, z = across
    sideways = slope[0] * u[0], slope[1] * u[1]
    rows = [
        (x * u[1] * half[1] - y * u[0] * half[0]) * wide,
        s * y - c * x,
        -s * x - c * y,
        -z,
        -sideways[0],
        -sideways[1],
        -u[2] * half[2] * z,
        -(sideways[0] + sideways[1]) * np.clip(u[2], -1, 1) / wide,
    ]
    return np.stack(rows).astype(np.float64)


def _weights(distance: Floats, seen: int, config: KinConfig) -> Array:
    """Geman and McClure's for seen points; free ones that are inside count fully."""
    weight = np.empty(distance.shape, np.float64)
    on, at = distance[:, :seen], distance[:, seen:]
    weight[:, :seen] = (1 / (1 + (on / config.robust) ** 2)) ** 2 / config.sigma**2 / max(seen, 1)
    weight[:, seen:] = config.free_pull * (at < 0) / config.free_sigma**2 / max(at.shape[1], 1)
    return weight


def _moved(placements: KinPlacements, step: Array, config: KinConfig) -> KinPlacements:
    step = limited(step, config)
    taper = np.clip(placements.taper + step[:, 7], -config.most_taper, config.most_taper)
    return KinPlacements(
        placements.stance,
        (placements.turn + step[:, 0]).astype(np.float32),
        (placements.middle + step[:, 1:4]).astype(np.float32),
        (placements.half * np.exp(step[:, 4:7])).astype(np.float32),
        taper.astype(np.float32),
    )
