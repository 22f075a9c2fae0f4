"""One shard: an HDF5 file with several objects. This file is its schema; nothing else writes one.

    /                       attributes: kind "brrp-prior-shard", schema (int), parameters (JSON)
    /objects/NAME           attributes: input_sha256, record (JSON), content_sha256
        box            (2, 3)  f8  metres, mesh frame: lower and upper corner of the closed mesh
        samples        (n, 3)  f4  normalised
        labels         (n,)    u1  1 = inside
        surface        (m, 3)  f4  normalised
        surface_normals(m, 3)  f4  unit, outward
        scales         (s,)    f8  the scan's scales, one cloud each
        cloud_starts   (s+1,)  i8  rows of cloud i: cloud_starts[i] to cloud_starts[i + 1]
        cloud_points   (p, 3)  f4  metres, multiplied by base_scale * scale
        cloud_normals  (p, 3)  f2
        cloud_fpfh     (p, 33) f2
        pose_T         (r, 4, 4) f8  T_plane_object, metres
        pose_probability (r,)  f8
        appearance/colour   (v, COLOUR_BINS) u1  square roots of histograms, 255 = 1; 0: no colours
        appearance/pairs    (v, PAIR_BINS)   u1  likewise
        appearance/sizes    (r, 3)  f4  metres: height, footprint in each resting pose
        mesh/vertices       (w, 3)  f4  normalised: the closed mesh
        mesh/faces          (t, 3)  i4  rows of vertices, outward
        mesh/colours        (w, 3)  u1  RGB; grey where nothing is known of them
        distances/lower     (3,)    f8  normalised: the first node of a grid of signed distances
        distances/spacing   (1,)    f8
        distances/values    (a, b, c) f2  negative inside

Every data set is chunked with fletcher32, shuffle and gzip. `content_sha256` covers the arrays and
the record, so that an object can be taken over from a shard that no manifest vouches for.
"""

from __future__ import annotations

import hashlib
import json
import math
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.descriptors.colour_histogram import COLOUR_BINS
from brrp_cli.descriptors.descriptor import Appearance
from brrp_cli.descriptors.point_pairs import PAIR_BINS
from brrp_cli.errors import PriorError
from brrp_cli.files import parse_json, write_bytes
from brrp_cli.hdf5 import hdf5_bytes
from brrp_cli.prior.chunks import check_chunks

if TYPE_CHECKING:
    import h5py

SCHEMA = 3
KIND = "brrp-prior-shard"
GZIP_LEVEL = 4
# What one object may take in memory; one with a million samples takes 40 MB.
MAX_OBJECT_BYTES = 2**28

APPEARANCE = "appearance"
DISTANCES = "distances"
MESH = "mesh"

# data set -> (dtype, shape; a letter is a length, the same wherever it stands, "s+1" one more)
ARRAYS: dict[str, tuple[str, tuple[int | str, ...]]] = {
    "box": ("<f8", (2, 3)),
    "samples": ("<f4", ("n", 3)),
    "labels": ("|u1", ("n",)),
    "surface": ("<f4", ("m", 3)),
    "surface_normals": ("<f4", ("m", 3)),
    "scales": ("<f8", ("s",)),
    "cloud_starts": ("<i8", ("s+1",)),
    "cloud_points": ("<f4", ("p", 3)),
    "cloud_normals": ("<f2", ("p", 3)),
    "cloud_fpfh": ("<f2", ("p", 33)),
    "pose_T": ("<f8", ("r", 4, 4)),
    "pose_probability": ("<f8", ("r",)),
    f"{APPEARANCE}/colour": ("|u1", ("v", COLOUR_BINS)),
    f"{APPEARANCE}/pairs": ("|u1", ("v", PAIR_BINS)),
    f"{APPEARANCE}/sizes": ("<f4", ("r", 3)),
    f"{MESH}/vertices": ("<f4", ("w", 3)),
    f"{MESH}/faces": ("<i4", ("t", 3)),
    f"{MESH}/colours": ("|u1", ("w", 3)),
    f"{DISTANCES}/lower": ("<f8", (3,)),
    f"{DISTANCES}/spacing": ("<f8", (1,)),
    f"{DISTANCES}/values": ("<f2", ("a", "b", "c")),
}


@dataclass(frozen=True)
class StoredObject:
    """An object as it lies in a shard: arrays by the names of `ARRAYS`, and plain JSON."""

    name: str
    input_sha256: str
    arrays: dict[str, NDArray[Any]]
    record: dict[str, Any]


def write_shard(path: Path, objects: list[StoredObject], parameters: dict[str, Any]) -> None:
    """Write a whole shard or none. The same objects give the same bytes. Errors: OutputError."""

    def fill(file: h5py.File) -> None:
        file.attrs["kind"] = KIND
        file.attrs["schema"] = SCHEMA
        file.attrs["parameters"] = json.dumps(parameters, sort_keys=True)
        for stored in objects:
            group = file.create_group(f"objects/{stored.name}")
            group.attrs["input_sha256"] = stored.input_sha256
            group.attrs["record"] = json.dumps(stored.record)
            group.attrs["content_sha256"] = _content_sha256(stored.arrays, stored.record)
            for key, (dtype, _) in ARRAYS.items():
                group.create_dataset(
                    key,
                    data=stored.arrays[key].astype(dtype),
                    chunks=True,
                    compression="gzip",
                    compression_opts=GZIP_LEVEL,
                    shuffle=True,
                    fletcher32=True,
                )

    write_bytes(path, hdf5_bytes(fill))


# Whatever h5py and NumPy make of bytes that are no shard.
_DAMAGE = (
    OSError,
    KeyError,
    ValueError,
    RuntimeError,
    TypeError,
    AttributeError,
    IndexError,
    OverflowError,
    MemoryError,
    zlib.error,
)


@contextmanager
def open_shard(path: Path) -> Iterator[h5py.File]:
    """Open to read; PriorError for what is no shard, is damaged, or is of another schema."""
    import h5py

    if not path.is_file():
        raise PriorError(
            "A shard is missing",
            where=path,
            fix="run brrp build-prior again; if one ran meanwhile, open the prior again",
        )
    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("kind") != KIND:
                raise PriorError("The file is no shard of a prior", where=path)
            schema = int(file.attrs["schema"])
            if schema != SCHEMA:
                raise PriorError(
                    "The shard was written by another version of brrp",
                    where=path,
                    expected=f"schema {SCHEMA}",
                    found=f"schema {schema}",
                    fix="build the prior anew, or read it with the version that built it",
                )
            yield file
    except _DAMAGE as error:
        raise damaged(path, error) from error


def damaged(path: object, found: object) -> PriorError:
    """The message for a shard whose bytes are not what they were."""
    return PriorError(
        "A shard is damaged",
        where=path,
        found=found,
        fix="run brrp build-prior again on the same meshes; it replaces damaged shards",
    )


def object_names(file: h5py.File) -> list[str]:
    """Names of the objects in an open shard."""
    import h5py

    if file.get("objects", getlink=True).__class__ is not h5py.HardLink:
        raise damaged(file.filename, "no group of objects")
    return sorted(file["objects"])


@dataclass
class _Reading:
    """Of one object: where, the lengths met so far by letter, and the bytes that they take."""

    where: str
    lengths: dict[str, int] = field(default_factory=dict)
    bytes: int = 0


def read_stored(file: h5py.File, name: str) -> StoredObject:
    """Read and check one object: links, shapes, types, checksums, finite values."""
    where = f"{file.filename}, {name}"
    reading = _Reading(where)
    group = _hard(file, f"objects/{name}", where)
    arrays: dict[str, NDArray[Any]] = {}
    for key, (dtype, shape) in ARRAYS.items():
        arrays[key] = _read_array(group, key, dtype, shape, reading)
    record = parse_json(group.attrs["record"])
    if _content_sha256(arrays, record) != group.attrs["content_sha256"]:
        raise damaged(where, "data that do not have the object's checksum")
    starts = arrays["cloud_starts"]
    if not (arrays[f"{DISTANCES}/spacing"][0] > 0 and min(arrays[f"{DISTANCES}/values"].shape) > 1):
        raise damaged(where, "distances without a grid")
    faces = arrays[f"{MESH}/faces"]
    if not len(faces) or faces.min() < 0 or faces.max() >= reading.lengths["w"]:
        raise damaged(where, "a mesh whose faces have corners that it lacks")
    if starts[0] != 0 or starts[-1] != reading.lengths["p"] or (np.diff(starts) < 0).any():
        raise damaged(where, "clouds that overlap")
    return StoredObject(name, str(group.attrs["input_sha256"]), arrays, record)


def read_appearance(file: h5py.File, name: str) -> Appearance:
    """Read one object's descriptors alone, with all checks but the checksum of the whole object."""
    where = f"{file.filename}, {name}"
    reading = _Reading(where)
    group = _hard(file, f"objects/{name}", where)
    arrays = {
        key.removeprefix(f"{APPEARANCE}/"): _read_array(group, key, dtype, shape, reading)
        for key, (dtype, shape) in ARRAYS.items()
        if key.startswith(f"{APPEARANCE}/")
    }
    return Appearance(**arrays)


def read_parts(file: h5py.File, name: str, keys: Sequence[str]) -> dict[str, NDArray[Any]]:
    """Read some of one object's arrays, with all checks but the checksum of the whole object."""
    where = f"{file.filename}, {name}"
    reading = _Reading(where)
    group = _hard(file, f"objects/{name}", where)
    return {key: _read_array(group, key, *ARRAYS[key], reading) for key in keys}


def _hard(group: h5py.Group, key: str, where: str) -> Any:
    import h5py

    # Soft and external links may lead to any file that the user can read.
    for part in key.split("/"):
        if part not in group or not isinstance(group.get(part, getlink=True), h5py.HardLink):
            raise damaged(where, f"no data set {key}")
        group = group[part]
    return group


def _read_array(
    group: h5py.Group,
    key: str,
    dtype: str,
    shape: tuple[int | str, ...],
    reading: _Reading,
) -> NDArray[Any]:
    where = reading.where
    data = _hard(group, key, where)
    found = f"{key}: {data.dtype.str} {data.shape}"
    fits = data.dtype == np.dtype(dtype) and len(data.shape) == len(shape)
    fits = fits and not data.is_virtual and data.external is None and data.fletcher32
    reading.bytes += math.prod(data.shape) * data.dtype.itemsize
    if not fits or reading.bytes > MAX_OBJECT_BYTES:
        raise damaged(where, f"{found}, expected {dtype} {shape} with checksums")
    for length, symbol in zip(data.shape, shape, strict=True):
        if isinstance(symbol, str):
            symbol, more = (symbol[0], 1) if symbol.endswith("+1") else (symbol, 0)
            expected = reading.lengths.setdefault(symbol, length - more) + more
        else:
            expected = symbol
        if length != expected:
            raise damaged(where, f"{found}, expected {expected} for {symbol!r}")
    check_chunks(data, f"{where}, {key}")
    array: NDArray[Any] = data[...]
    if not np.isfinite(array).all():
        raise damaged(where, f"{key}: values that are NaN or infinite")
    return array


def _content_sha256(arrays: dict[str, NDArray[Any]], record: dict[str, Any]) -> str:
    digest = hashlib.sha256(json.dumps(record, sort_keys=True).encode())
    for key, (dtype, _) in ARRAYS.items():
        array = np.ascontiguousarray(arrays[key].astype(dtype))
        digest.update(f"{key}{array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()
