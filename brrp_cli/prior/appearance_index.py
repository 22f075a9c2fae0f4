"""The appearance of all objects, as retrieval reads it: a first look at all, the rest by row.

`appearance-KEY.npz` lies beside the descriptors of the same key (see appearance_file.py), which are
8 kB for each object, and holds 0.4 kB of each: what a first look compares, and a checksum of the
row.
So neither a start nor a lookup reads the whole of the descriptors, and no row that is damaged is
used. Where the file is missing, damaged or of other descriptors, it is made again.

Arrays: `colour` (n, COLOUR_BINS) and `pairs` (n, PAIR_BINS) uint8, the mean over views of the
stored square roots, scaled to a length of 255, 0 where there is none; `sizes` (n, r, 3) float32 as
stored; `crc32` (n,) uint32 of the rows; `appearance`, sha256 of the file with the rows.
"""

from __future__ import annotations

import logging
import zlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import BrrpError, OutputError
from brrp_cli.files import atomic_path
from brrp_cli.frames.arrays import MAX_BYTES, read_npz
from brrp_cli.prior.appearance_file import (
    has_size,
    is_whole,
    read_sidecar,
    restore_sidecar,
    row_type,
)
from brrp_cli.prior.index import Index
from brrp_cli.prior.manifest import Manifest, ShardEntry

_CHUNK = 1_000

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class AppearanceSummary:
    """The arrays of the file, see above; row i is that of object i."""

    colour: NDArray[np.uint8]
    pairs: NDArray[np.uint8]
    sizes: NDArray[np.float32]
    crc32: NDArray[np.uint32]


_NAMES = tuple(field.name for field in fields(AppearanceSummary))


@dataclass(frozen=True)
class AppearanceIndex:
    """first : of all objects; rows : structured rows (m,) with `colour` (v, COLOUR_BINS), `pairs`
    (v, PAIR_BINS) and `sizes` (r, 3) of the objects (m,) that are asked for."""

    first: AppearanceSummary
    rows: Callable[[NDArray[np.int64]], NDArray[Any]]

    def __len__(self) -> int:
        return len(self.first.colour)


def first_look(table: NDArray[Any]) -> AppearanceSummary:
    """Of descriptors (n,)."""
    parts = [
        (_mean_roots(rows["colour"]), _mean_roots(rows["pairs"]), rows["sizes"], _crc32(rows))
        for rows in (table[start : start + _CHUNK] for start in range(0, len(table), _CHUNK))
    ]
    return AppearanceSummary(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def open_appearance_index(
    folder: Path, index: Index, manifest: Callable[[], Manifest]
) -> AppearanceIndex:
    """The appearance of a prior's objects.

    manifest : asked for only where descriptors have to be made again from the shards. Errors:
    PriorError.
    """
    entry = index.appearance
    rows = _Rows(folder, entry, row_type(index.parameters), len(index.names), manifest)
    first = _read(folder, entry, rows) if has_size(folder, entry) else None
    if first is None:
        if is_whole(folder, entry):
            table = read_sidecar(folder, entry, index.parameters, len(index.names))
        else:
            table = rows.restore()
        first = first_look(table)
        _write(folder, entry, first)
    rows.crc32 = first.crc32
    return AppearanceIndex(first, rows)


@dataclass
class _Rows:
    """Reads rows (m,) of the file `entry`; where they are damaged, all are made again."""

    folder: Path
    entry: ShardEntry
    kind: np.dtype[Any]
    count: int
    manifest: Callable[[], Manifest]
    crc32: NDArray[np.uint32] | None = None
    restored: NDArray[Any] | None = None

    def __call__(self, wanted: NDArray[np.int64]) -> NDArray[Any]:
        if self.restored is None:
            found = self._from_file(wanted)
            if self.crc32 is not None and np.array_equal(_crc32(found), self.crc32[wanted]):
                return found
        return np.asarray(self.restore()[wanted])

    def restore(self) -> NDArray[Any]:
        """All rows, from the shards."""
        if self.restored is None:
            self.restored = restore_sidecar(self.folder, self.manifest())
        return self.restored

    def _from_file(self, wanted: NDArray[np.int64]) -> NDArray[Any]:
        """Not through a map: the pages around each row would count as memory that is used."""
        size = self.kind.itemsize
        start = self.entry.bytes - self.count * size
        data = bytearray(len(wanted) * size)
        places = memoryview(data)
        with suppress(OSError), (self.folder / self.entry.file).open("rb", buffering=0) as stream:
            for place, row in enumerate(wanted.tolist()):
                stream.seek(start + row * size)
                stream.readinto(places[place * size : (place + 1) * size])
        return np.frombuffer(data, self.kind)


def _path(folder: Path, entry: ShardEntry) -> Path:
    return (folder / entry.file).with_suffix(".npz")


def _read(folder: Path, entry: ShardEntry, rows: _Rows) -> AppearanceSummary | None:
    """What the file says, if it is whole and of these descriptors."""
    try:
        # Larger than a frame may be, in a large prior, but never larger than the rows.
        limit = max(MAX_BYTES, entry.bytes)
        arrays, _ = read_npz(_path(folder, entry), frozenset({*_NAMES, "appearance"}), limit)
        first = AppearanceSummary(**{name: arrays[name] for name in _NAMES})
        digest = str(arrays["appearance"])
    except (BrrpError, KeyError):
        return None
    empty = first_look(np.zeros(1, rows.kind))
    fits = all(
        getattr(first, name).shape == (rows.count, *getattr(empty, name).shape[1:])
        and getattr(first, name).dtype == getattr(empty, name).dtype
        for name in _NAMES
    )
    return first if fits and digest == entry.sha256 else None


def _write(folder: Path, entry: ShardEntry, first: AppearanceSummary) -> None:
    """Keep it, unless the folder cannot be written: nothing but time is lost then."""
    path = _path(folder, entry)
    try:
        with atomic_path(path) as partial, partial.open("wb") as stream:
            np.savez(stream, appearance=np.array(entry.sha256), **vars(first))
    except OutputError as error:
        log.info("%s cannot be kept: %s", path, error.found)


def _mean_roots(stored: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Mean over views of stored square roots (n, v, b), scaled to a length of 255: (n, b)."""
    mean = stored.mean(axis=1, dtype=np.float32)
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    return np.rint(255 * mean / np.where(length > 0, length, 1.0)).astype(np.uint8)


def _crc32(rows: NDArray[Any]) -> NDArray[np.uint32]:
    return np.array([zlib.crc32(row.tobytes()) for row in rows], dtype=np.uint32)
