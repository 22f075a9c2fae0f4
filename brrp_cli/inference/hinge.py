"""Hilbert-map features on a grid of hinge points (paper, section III-A).

phi(x) = [1, k(x - h_1), ..., k(x - h_H)] with k(d) = exp(-|d|^2 / s^2), where s is the spacing of
the grid. The Gaussian is separable: a feature is the product of three factors, one for each axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True)
class HingeGrid:
    """Hinge points lower + spacing * (i, j, k), metres from the map's centre; `spacing` is the
    width of the kernel too.

    lower : coordinates of the first one; counts : how many along each axis. Hinge (i, j, k) is
    number 1 + (i * ny + j) * nz + k of a weight vector; number 0 is the bias. Kernel values under
    `floor` are 0, as in the authors' code.
    """

    lower: tuple[float, float, float]
    counts: tuple[int, int, int]
    spacing: float
    floor: float

    @property
    def dimension(self) -> int:
        """Length of a weight vector."""
        return math.prod(self.counts) + 1


def cubic_grid(per_axis: int, half_width: float, floor: float) -> HingeGrid:
    """`per_axis`^3 hinge points in a cube of half-width `half_width` metres around the origin."""
    spacing = 2 * half_width / (per_axis - 1)
    low = -half_width
    return HingeGrid((low, low, low), (per_axis, per_axis, per_axis), spacing, floor)


def axis_factors(coordinates: Tensor, grid: HingeGrid, axis: int) -> Tensor:
    """Kernels along one axis (..., counts[axis]) of coordinates (...), metres from the centre.

    One under the grid's floor is 0, since no product with it reaches the floor either. Products of
    three small kernels would be denormal numbers, which some processors multiply 20 times slower.
    """
    steps = torch.arange(grid.counts[axis], dtype=coordinates.dtype, device=coordinates.device)
    hinges = grid.lower[axis] + grid.spacing * steps
    exponent = -(((coordinates[..., None] - hinges) / grid.spacing) ** 2)
    # Held a little below the floor, so that not even what is cut is denormal.
    least = math.log(max(torch.finfo(torch.float32).tiny, grid.floor)) - 1
    kernel = torch.exp(exponent.clamp_(min=least))
    return torch.where(kernel < grid.floor, 0.0, kernel)


def features(points: Tensor, grid: HingeGrid) -> Tensor:
    """phi (..., H + 1) of points (..., 3), metres from the map's centre."""
    x, y, z = (axis_factors(points[..., axis], grid, axis) for axis in range(3))
    kernel = x[..., :, None, None] * y[..., None, :, None] * z[..., None, None, :]
    kernel = kernel.flatten(start_dim=-3)
    kernel = torch.where(kernel < grid.floor, 0.0, kernel)
    return torch.cat([torch.ones_like(kernel[..., :1]), kernel], dim=-1)


@dataclass(frozen=True)
class Factors:
    """phi of points (n,) as a product: `first` (n, nx) along x, `rest` (n, ny * nz) of the others.

    A tenth of the numbers of phi, and all that products with it need. The floor holds along each
    axis and not for the product, which changes a logit by at most floor * |w|_1; the bias is left
    out.
    """

    first: Tensor
    rest: Tensor

    def rows(self, index: Tensor) -> Factors:
        """Of the points `index` (m,)."""
        # Six times as fast as to write first[index].
        return Factors(self.first.index_select(0, index), self.rest.index_select(0, index))

    def dot(self, kernels: Tensor) -> Tensor:
        """phi . w (P, n) of kernels' weights (P, H)."""
        count, across = kernels.shape[0], self.first.shape[1]
        inner = self.rest @ kernels.reshape(count * across, -1).mT
        return torch.einsum("npi,ni->pn", inner.reshape(-1, count, across), self.first)

    def transpose_dot(self, values: Tensor) -> Tensor:
        """sum_i values_i phi_i (P, H) of values (P, n)."""
        count = values.shape[0]
        spread = (values[:, None] * self.first.mT).flatten(end_dim=1)
        return (spread @ self.rest).reshape(count, -1)


def factors(points: Tensor, grid: HingeGrid) -> Factors:
    """Of points (n, 3), metres from the map's centre."""
    x, y, z = (axis_factors(points[:, axis], grid, axis) for axis in range(3))
    return Factors(x, (y[:, :, None] * z[:, None, :]).flatten(start_dim=1))


def grid_logits(weights: Tensor, axes: tuple[Tensor, Tensor, Tensor], grid: HingeGrid) -> Tensor:
    """w . phi on a whole grid: (P, nx, ny, nz) for weights (P, H + 1) and its three axes.

    Contracts one axis after the other and never forms a feature. The floor holds along each axis
    and not for the product, which changes a logit by at most floor * |w|_1.
    """
    shape = (weights.shape[0], *grid.counts)
    x, y, z = (axis_factors(each, grid, axis) for axis, each in enumerate(axes))
    volume = torch.einsum("pijk,zk->pijz", weights[:, 1:].reshape(shape), z)
    volume = torch.einsum("pijz,yj->piyz", volume, y)
    volume = torch.einsum("piyz,xi->pxyz", volume, x)
    return volume + weights[:, 0, None, None, None]
