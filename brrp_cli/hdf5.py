"""What several files of HDF5 need.

They are made in memory and written by Python: where the HDF5 library writes itself, a full disk is
a RuntimeError at best; at worst it keeps the file and fails again when the process ends.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

if TYPE_CHECKING:
    import h5py
    from numpy.typing import NDArray

T = TypeVar("T")


def hdf5_bytes(fill: Callable[[h5py.File], None]) -> bytes:
    """The bytes of the HDF5 file that `fill` makes; those that h5py would write to a disk."""
    import h5py

    with h5py.File("in memory", "w", driver="core", backing_store=False) as file:
        fill(file)
        file.flush()
        return bytes(file.id.get_file_image())


def members(group: h5py.Group) -> Iterator[tuple[str, Any]]:
    """Name and member of each member of `group`.

    For comprehensions that may end with an error. h5py's own `items` and `values` hold the lock of
    the whole library until their iterator is deleted, which a traceback that holds a comprehension
    puts off. Until then any other thread waits that touches h5py, even to delete an object.
    """
    return ((name, group[name]) for name in group)


class SharedParts:
    """What several objects of one file have in common: written once, read once.

    Each part is a group below `group`. An object keeps the name that `write` gave it and reads the
    part back by that name.
    """

    def __init__(self, group: h5py.Group) -> None:
        self._group = group
        self._written: list[tuple[object, str]] = []
        self._read: dict[str, Any] = {}

    def write(self, name: str, part: T, fill: Callable[[h5py.Group, T], None]) -> str:
        """Write `part` with `fill(group, part)` unless this very part was written before; returns
        the name of its group, which is `name` for the first of that name."""
        for known, where in self._written:
            if known is part:
                return where
        taken = {where for _, where in self._written}
        others = (f"{name}_{i}" for i in range(1, len(taken) + 1))
        where = next(each for each in (name, *others) if each not in taken)
        fill(self._group.create_group(where), part)
        self._written.append((part, where))
        return where

    def read(self, name: str, read: Callable[[h5py.Group], T]) -> T:
        """The part of that name; all objects that ask for it get the same one.

        Errors: KeyError where there is none, and those of `read`.
        """
        if name not in self._read:
            self._read[name] = read(self._group[name])
        found: T = self._read[name]
        return found


def stored_motion(attributes: Mapping[str, Any], name: str) -> NDArray[np.float64] | None:
    """The attribute T (4, 4) of that name; None where there is none. Errors: ValueError."""
    if name not in attributes:
        return None
    T = np.asarray(attributes[name], dtype=np.float64)
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise ValueError(f"{name} is no transform")
    return T


def write_compressed(group: h5py.Group, name: str, data: NDArray[Any]) -> None:
    """A data set, compressed, with a checksum for each chunk."""
    group.create_dataset(
        name, data=data, chunks=True, compression="gzip", shuffle=True, fletcher32=True
    )
