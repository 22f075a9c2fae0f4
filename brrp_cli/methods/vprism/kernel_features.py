"""Gaussian kernel features of many points, kept as dense blocks.

A kernel that is a few centimetres wide sees few of a scene's hinge points from any one place, so
the feature matrix Phi (points by hinge points) is nearly all zeros. Points are grouped by the cube
they lie in; all points of a cube share the columns that can be non-zero there. Every product with
Phi then costs what the neighbourhood costs, not what the scene costs, and runs on dense matrices.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class KernelBasis:
    """phi(x) = (exp(-gamma |x - h_1|^2), ..., exp(-gamma |x - h_H|^2), 1).

    hinges : (H, 3) float64, metres
    gamma : 1 / m^2
    floor : features below it are 0, which is what makes the matrix sparse
    """

    hinges: Floats
    gamma: float
    floor: float

    @property
    def size(self) -> int:
        """Number of features, the bias included."""
        return len(self.hinges) + 1

    @property
    def reach(self) -> float:
        """Distance from a hinge point, metres, at which its feature falls to the floor."""
        return float(np.sqrt(-np.log(self.floor) / self.gamma))


@dataclass(frozen=True)
class FeatureBlock:
    """Rows and columns of Phi outside of which nothing in these rows is non-zero.

    rows : (n,) int; columns : (a,) int, ascending, the bias last; values : (n, a) float64
    size : number of columns of Phi
    """

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    values: Floats
    size: int

    @cached_property
    def square(self) -> NDArray[np.intp]:
        """Places (a, a) of columns x columns in a flattened (size, size) matrix.

        NumPy gathers and scatters by one flat index several times faster than by two.
        """
        return self.columns[:, None] * self.size + self.columns


@dataclass(frozen=True)
class BlockFeatures:
    """Phi, (n, size), as blocks that hold every row once."""

    n: int
    size: int
    blocks: list[FeatureBlock]

    def gram(self, weights: Floats) -> Floats:
        """Phi^T diag(weights) Phi, (size, size), of weights (n,), none negative."""
        root = np.sqrt(weights)
        total = np.zeros(self.size**2)
        for block in self.blocks:
            # One array times its own transpose: NumPy computes half of it and mirrors.
            weighted = block.values * root[block.rows, None]
            total[block.square] += weighted.T @ weighted
        return total.reshape(self.size, self.size)

    def transpose_dot(self, values: Floats) -> Floats:
        """Phi^T values, (size,), of values (n,)."""
        total = np.zeros(self.size)
        for block in self.blocks:
            total[block.columns] += values[block.rows] @ block.values
        return total

    def dot(self, vector: Floats) -> Floats:
        """Phi vector, (n,), of a vector (size,)."""
        result = np.empty(self.n)
        for block in self.blocks:
            result[block.rows] = block.values @ vector[block.columns]
        return result

    def quadratic(self, matrix: NDArray[np.floating]) -> Floats:
        """phi_i^T matrix phi_i, (n,), of a matrix (size, size)."""
        result = np.empty(self.n)
        for block in self.blocks:
            near = matrix.take(block.square)
            result[block.rows] = np.einsum("ij,ij->i", block.values @ near, block.values)
        return result


def kernel_features(points: Floats, basis: KernelBasis, cell: float) -> BlockFeatures:
    """Features of points (n, 3), metres, grouped by cubes of side `cell`, metres.

    The cubes lie on a fixed grid, so a point's columns do not depend on the other points.
    """
    blocks = [_block(points, rows, corner, basis, cell) for rows, corner in _cubes(points, cell)]
    return BlockFeatures(n=len(points), size=basis.size, blocks=blocks)


def _cubes(points: Floats, cell: float) -> list[tuple[NDArray[np.intp], Floats]]:
    """Rows of each occupied cube of the grid, with its lower corner (3,)."""
    if not len(points):
        return []
    keys, inverse = np.unique(np.floor(points / cell).astype(np.int64), axis=0, return_inverse=True)
    order = np.argsort(inverse.ravel(), kind="stable")
    ends = np.cumsum(np.bincount(inverse.ravel(), minlength=len(keys)))
    return list(zip(np.split(order, ends[:-1]), keys * cell, strict=True))


def _block(
    points: Floats, rows: NDArray[np.intp], corner: Floats, basis: KernelBasis, cell: float
) -> FeatureBlock:
    gap = basis.hinges - np.clip(basis.hinges, corner, corner + cell)
    near = np.flatnonzero(np.einsum("ij,ij->i", gap, gap) <= basis.reach**2)
    difference = points[rows][:, None] - basis.hinges[near][None]
    values = np.exp(-basis.gamma * np.einsum("ijk,ijk->ij", difference, difference))
    values[values < basis.floor] = 0.0
    return FeatureBlock(
        rows=rows,
        columns=np.append(near, basis.size - 1),
        values=np.column_stack([values, np.ones(len(rows))]),
        size=basis.size,
    )
