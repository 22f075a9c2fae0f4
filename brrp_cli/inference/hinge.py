"""Hilbert-map features on a grid of hinge points (paper, section III-A).

phi(x) = [1, k(x - h_1), ..., k(x - h_H)] with k(d) = exp(-|d|^2 / s^2), where s is the spacing of
the grid. The Gaussian is separable: a feature is the product of three factors, one for each axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True)
class HingeGrid:
    """`per_axis`^3 hinge points in a cube of half-width `half_width` metres around the origin.

    Hinge (i, j, k) is number 1 + (i * per_axis + j) * per_axis + k of a weight vector; number 0 is
    the bias.
    """

    per_axis: int
    half_width: float
    floor: float

    @property
    def spacing(self) -> float:
        """Distance of neighbouring hinge points, and width of the kernel, metres."""
        return 2 * self.half_width / (self.per_axis - 1)

    @property
    def dimension(self) -> int:
        """Length of a weight vector."""
        return self.per_axis**3 + 1


def axis_factors(coordinates: Tensor, grid: HingeGrid) -> Tensor:
    """Kernels along one axis (..., per_axis) of coordinates (...), metres from the centre."""
    hinges = torch.linspace(
        -grid.half_width,
        grid.half_width,
        grid.per_axis,
        dtype=coordinates.dtype,
        device=coordinates.device,
    )
    return torch.exp(-(((coordinates[..., None] - hinges) / grid.spacing) ** 2))


def features(points: Tensor, grid: HingeGrid) -> Tensor:
    """phi (..., H + 1) of points (..., 3), metres from the grid's centre.

    Kernel values under `grid.floor` are 0, as in the authors' code.
    """
    factors = axis_factors(points, grid)
    x, y, z = factors.unbind(dim=-2)
    kernel = x[..., :, None, None] * y[..., None, :, None] * z[..., None, None, :]
    kernel = kernel.flatten(start_dim=-3)
    kernel = torch.where(kernel < grid.floor, 0.0, kernel)
    return torch.cat([torch.ones_like(kernel[..., :1]), kernel], dim=-1)


def lattice_logits(weights: Tensor, axes: tuple[Tensor, Tensor, Tensor], grid: HingeGrid) -> Tensor:
    """w . phi on a whole lattice: (P, nx, ny, nz) for weights (P, H + 1) and its three axes.

    Contracts one axis after the other and never forms a feature. Only the floor is left out, which
    changes a logit by at most floor * |w|_1.
    """
    shape = (weights.shape[0], grid.per_axis, grid.per_axis, grid.per_axis)
    x, y, z = (axis_factors(axis, grid) for axis in axes)
    volume = torch.einsum("pijk,zk->pijz", weights[:, 1:].reshape(shape), z)
    volume = torch.einsum("pijz,yj->piyz", volume, y)
    volume = torch.einsum("piyz,xi->pxyz", volume, x)
    return volume + weights[:, 0, None, None, None]
