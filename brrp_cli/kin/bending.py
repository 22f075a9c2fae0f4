"""Non-rigid refinement of one fit: points of its surface are brought onto what was seen, by damped
Gauss-Newton steps over place, scales and a smooth bend."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brrp_cli.config import KinConfig
from brrp_cli.geometry import turn_about_z
from brrp_cli.kin import bend, unknowns
from brrp_cli.kin.evidence import Evidence
from brrp_cli.kin.ways_out import ways_out

Array = NDArray[np.float64]

# Those of a stretched shape; then the bend's coefficients.
FIRST = unknowns.UNKNOWNS
BENT_UNKNOWNS = FIRST + 3 * bend.TERMS


@dataclass(frozen=True)
class BoxPoints:
    """Points u (n, 3) of a stored shape's box, with what a bend is made of there, (n, K) and
    (n, K, 3): it stays what it is however the shape is bent, and is computed once."""

    u: Array

    @cached_property
    def terms(self) -> Array:
        """As `bend.terms` has them."""
        return bend.terms(self.u)

    @cached_property
    def slopes(self) -> Array:
        """As `bend.slopes` has them."""
        return bend.slopes(self.u)

    def rows(self, chosen: NDArray[np.int64]) -> BoxPoints:
        """Those of the points."""
        part = BoxPoints(self.u[chosen])
        part.__dict__["terms"] = self.terms[chosen]
        return part


@dataclass(frozen=True)
class BentFit:
    """x_plane = Rz(turn) diag(s, s, 1) diag(half) v + middle, with v = u + w(u) and
    s = 1 + taper v_z (placement.py, bend.py).

    stored_half : (3,) metres, of the stored object's box in this resting pose; turn : radians;
    middle, half : (3,) metres; bend : (3, K)
    """

    stored_half: Array
    turn: float
    middle: Array
    half: Array
    taper: float
    bend: Array

    def placed(self, points: BoxPoints) -> Array:
        """(n, 3) metres, frame of the plane, of points of the stored shape's box."""
        v = points.u + points.terms @ self.bend.T
        return (v * self._sizes(v)) @ self._turned.T + self.middle

    def normals(self, points: BoxPoints, stored: Array) -> Array:
        """(n, 3) unit, frame of the plane, where the stored shape's normals along u are (n, 3)."""
        v = points.u + points.terms @ self.bend.T
        A = np.eye(3) + np.einsum("ak,nkj->naj", self.bend, points.slopes)
        A = A * self._sizes(v)[:, :, None]
        found = np.linalg.solve(A.transpose(0, 2, 1), stored[..., None])[..., 0] @ self._turned.T
        return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))

    def along(self, points: BoxPoints, way: Array) -> Array:
        """(E, n): how far points go along `way` (n, 3) with each unknown."""
        v = points.u + points.terms @ self.bend.T
        sizes = self._sizes(v)
        local = way @ self._turned
        each = local * v * sizes
        moved = (v * sizes) @ self._turned.T
        first = np.stack(
            [
                way[:, 1] * moved[:, 0] - way[:, 0] * moved[:, 1],
                *way.T,
                *each.T,
                (each[:, 0] + each[:, 1]) / sizes[:, 0] * self.half[0] * np.clip(v[:, 2], -1, 1),
            ]
        )
        curved = np.einsum("na,nk->akn", local * sizes, points.terms)
        return np.concatenate([first, curved.reshape(-1, len(v))])

    def stepped(self, step: Array, config: KinConfig) -> BentFit:
        """After a step (E,), no part of which is longer than a step of `refined` may be."""
        first = unknowns.limited(step[:FIRST], config)
        taper = np.clip(self.taper + first[7], -config.most_taper, config.most_taper)
        curved = self.bend + step[FIRST:].reshape(self.bend.shape)
        return replace(
            self,
            turn=self.turn + float(first[0]),
            middle=self.middle + first[1:4],
            half=self.half * np.exp(first[4:7]),
            taper=float(taper),
            bend=bend.unfolded(curved, config.bend_steepest),
        )

    @property
    def _turned(self) -> Array:
        return turn_about_z(self.turn)

    def _sizes(self, v: Array) -> Array:
        """(n, 3): metres of one unit of v."""
        wide = 1 + self.taper * np.clip(v[:, 2], -1, 1)
        return self.half * np.column_stack([wide, wide, np.ones_like(wide)])


def bent(
    fit: BentFit,
    surface: Array,
    normals: Array,
    evidence: Evidence,
    config: KinConfig,
) -> tuple[BentFit, float]:
    """The fit, and what speaks against it, after `config.bend_steps` steps, of which those
    that make it worse are not taken.

    surface, normals : (n, 3) points of the stored shape's surface and its normals there, along u
    """
    precision = bend.prior_precision(fit.stored_half, config)
    points = BoxPoints(surface)
    cost, H, g = _system(fit, points, normals, evidence, precision, config)
    damping = config.bend_damping
    for _ in range(config.bend_steps):
        held = H + damping * np.diag(np.diag(H)) + unknowns.LEAST_WEIGHT * np.eye(BENT_UNKNOWNS)
        step = -np.asarray(np.linalg.solve(held, g), dtype=np.float64)
        tried = fit.stepped(step, config)
        found = _system(tried, points, normals, evidence, precision, config)
        if found[0] < cost:
            fit, (cost, H, g), damping = tried, found, damping / 4
        else:
            damping *= 8
    return fit, cost


def _system(
    fit: BentFit,
    surface: BoxPoints,
    stored_normals: Array,
    evidence: Evidence,
    precision: Array,
    config: KinConfig,
) -> tuple[float, Array, Array]:
    """Cost, its Gauss-Newton Hessian (E, E) and its gradient (E,)."""
    cost, H, g = _prior(fit, precision, config)
    points = fit.placed(surface)
    normals = fit.normals(surface, stored_normals)
    # What was seen faces the camera: of a wall, the side that does.
    facing = np.flatnonzero(np.einsum("ni,ni->n", normals, evidence.eye - points) > 0)
    seen = evidence.seen.astype(np.float64)
    if len(facing):
        _, nearest = cKDTree(points[facing]).query(seen)
        row = facing[nearest]
        apart, way = seen - points[row], normals[row]
        off = np.einsum("ni,ni->n", apart, way)
        length = np.linalg.norm(apart, axis=1)
        # Beyond an edge no surface is near: it is to reach as far.
        beyond = np.sqrt(np.maximum(length**2 - off**2, 0)) > config.bend_beyond
        way = np.where(beyond[:, None], apart / np.maximum(length, 1e-9)[:, None], way)
        off = np.where(beyond, length, off)
        ratio = 1 / (1 + (off / config.robust) ** 2)
        share = 1 / config.sigma**2 / len(seen)
        cost += share * float((off**2 * ratio).sum()) / 2
        _add(H, g, -fit.along(surface.rows(row), way), off, share * ratio**2)
    amount, way = ways_out(points, evidence, config)
    there = np.flatnonzero(amount)
    if len(there):
        share = config.out_pull / config.free_sigma**2 / len(points)
        off = amount[there]
        slack = np.minimum(1, config.robust / off)
        cost += share * float((off**2 * slack * (2 - slack)).sum()) / 2
        _add(H, g, -fit.along(surface.rows(there), way[there]), off, share * slack)
    return cost, H, g


def _add(H: Array, g: Array, rows: Array, residual: Array, weight: Array) -> None:
    H += (rows * weight) @ rows.T
    g += rows @ (weight * residual)


def _prior(fit: BentFit, precision: Array, config: KinConfig) -> tuple[float, Array, Array]:
    """Of the stretched shape and of the bend."""
    H, g = np.zeros((BENT_UNKNOWNS, BENT_UNKNOWNS)), np.zeros(BENT_UNKNOWNS)
    cost, first_H, first_g = unknowns.size_prior(
        fit.half[None],
        fit.stored_half[None],
        fit.middle[None, 2],
        np.array([fit.taper]),
        config,
    )
    pull = config.pull * precision @ fit.bend.ravel()
    H[:FIRST, :FIRST], g[:FIRST] = first_H[0], first_g[0]
    H[FIRST:, FIRST:], g[FIRST:] = config.pull * precision, pull
    return float(cost[0] + fit.bend.ravel() @ pull / 2), H, g
