"""V-PRISM's map of a whole scene in a file.

    gamma, feature_floor
    hinges         (H, 3) float64, metres, camera frame
    mean           (K, F) float64, F = H + 1, the bias last; class 0 is free space
    covariance     (K, N) float64, the entries that can count, see `counting_pairs`

Covariances are large: (K, F, F) float64 is 113 MB for ten objects. No point is near two hinges
that are far from each other, so most entries only ever meet features that are 0. Without them and
without the mirrored half, 18 MB remain, and every answer stays what it was to the last bit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrp_cli.methods.vprism.kernel_features import KernelBasis
from brrp_cli.methods.vprism.softmax_map import SoftmaxMap

if TYPE_CHECKING:
    import h5py

Pairs = tuple[NDArray[np.intp], NDArray[np.intp]]


def counting_pairs(basis: KernelBasis) -> Pairs:
    """Rows and columns (N,) of the upper triangle whose two features some point can both have.

    A feature is 0 beyond `basis.reach` of its hinge, so two hinges may lie twice that apart.
    """
    gap = basis.hinges[:, None] - basis.hinges[None]
    counts = np.ones((basis.size, basis.size), dtype=bool)
    counts[:-1, :-1] = np.einsum("ijk,ijk->ij", gap, gap) <= (2 * basis.reach) ** 2
    rows, columns = np.nonzero(np.triu(counts))
    return rows, columns


def write_map(group: h5py.Group, scene: SoftmaxMap) -> None:
    """Write the scene's map; the same map gives the same bytes."""
    group.attrs["gamma"] = scene.basis.gamma
    group.attrs["feature_floor"] = scene.basis.floor
    rows, columns = counting_pairs(scene.basis)
    _write(group, "hinges", scene.basis.hinges)
    _write(group, "mean", scene.mean)
    _write(group, "covariance", scene.covariance[:, rows, columns])


def read_map(group: h5py.Group) -> SoftmaxMap:
    """The map that `write_map` wrote; covariances that cannot count are 0 in it.

    Errors: KeyError or ValueError where something is missing or does not fit the rest.
    """
    basis = KernelBasis(
        np.asarray(group["hinges"], dtype=np.float64),
        float(group.attrs["gamma"]),
        float(group.attrs["feature_floor"]),
    )
    mean = np.asarray(group["mean"], dtype=np.float64)
    packed = np.asarray(group["covariance"], dtype=np.float64)
    rows, columns = counting_pairs(basis)
    if mean.shape[1:] != (basis.size,) or packed.shape != (len(mean), len(rows)):
        raise ValueError(
            f"{len(basis.hinges)} hinges, but mean {mean.shape} and covariance {packed.shape}"
        )
    covariance = np.zeros((len(mean), basis.size, basis.size))
    covariance[:, rows, columns] = packed
    covariance[:, columns, rows] = packed
    return SoftmaxMap(basis, mean, covariance)


def _write(group: h5py.Group, name: str, data: NDArray[np.float64]) -> None:
    # One row of a chunk: rows are classes, and what fits a chunk is checked as a whole.
    chunks = (1, *data.shape[1:])
    group.create_dataset(name, data=data, chunks=chunks, fletcher32=True)
