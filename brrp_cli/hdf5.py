"""HDF5 files that are made in memory and written by Python.

Where the HDF5 library writes itself, a full disk is a RuntimeError at best; at worst it keeps the
file and fails again when the process ends.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import h5py


def hdf5_bytes(fill: Callable[[h5py.File], None]) -> bytes:
    """The bytes of the HDF5 file that `fill` makes; those that h5py would write to a disk."""
    import h5py

    with h5py.File("in memory", "w", driver="core", backing_store=False) as file:
        fill(file)
        file.flush()
        return bytes(file.id.get_file_image())
