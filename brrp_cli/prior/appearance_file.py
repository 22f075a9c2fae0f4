"""The appearance of all objects in one file, so that a lookup reads no shard.

`appearance-KEY.npy` is a structured array, one row for each object in the order of their names. It
holds nothing that the shards do not: where it is missing or damaged, it is made again from them, to
the same bytes. appearance_index.py reads the rows that are looked at.
"""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.descriptors.colour_histogram import COLOUR_BINS
from brrp_cli.descriptors.descriptor import Appearance
from brrp_cli.descriptors.point_pairs import PAIR_BINS
from brrp_cli.errors import OutputError, PriorError
from brrp_cli.files import atomic_path, sha256_file, trouble_of
from brrp_cli.prior.manifest import Manifest, ObjectEntry, ShardEntry
from brrp_cli.prior.shard import damaged, open_shard, read_appearance

# (name, input_sha256) -> an object's row.
Rows = dict[tuple[str, str], Any]

# Views, and poses, that anybody may ask for.
_MOST = 10_000

log = logging.getLogger(__name__)


def sidecar_file(objects: Sequence[ObjectEntry], parameters: dict[str, Any]) -> str:
    """Name of the file, from all that decides its content."""
    key = json.dumps([parameters, [[o.name, o.input_sha256] for o in objects]], sort_keys=True)
    return f"appearance-{hashlib.sha256(key.encode()).hexdigest()[:16]}.npy"


def write_sidecar(
    folder: Path,
    objects: Sequence[ObjectEntry],
    parameters: dict[str, Any],
    kept: Rows | None = None,
) -> ShardEntry:
    """Write the file of these objects, whole or not at all. Errors: PriorError, OutputError.

    kept : rows that are known already, so that their shards need not be read
    """
    file = sidecar_file(objects, parameters)
    kind = row_type(parameters)
    header = {
        "descr": np.lib.format.dtype_to_descr(kind),
        "fortran_order": False,
        "shape": (len(objects),),
    }
    # Written, not mapped: on a full disk a map ends the process without a word.
    with atomic_path(folder / file) as partial, partial.open("wb") as stream:
        np.lib.format.write_array_header_1_0(stream, header)
        for row in _rows(kind, folder, objects, kept or {}):
            stream.write(row.tobytes())
    return ShardEntry(file, sha256_file(folder / file), (folder / file).stat().st_size)


def kept_rows(folder: Path, manifest: Manifest) -> Rows:
    """The rows of a prior's file; none where it is missing or damaged."""
    entry = manifest.appearance
    if not is_whole(folder, entry):
        return {}
    table = np.asarray(read_sidecar(folder, entry, manifest.parameters, len(manifest.objects)))
    return {(o.name, o.input_sha256): table[row] for row, o in enumerate(manifest.objects)}


def is_whole(folder: Path, entry: ShardEntry) -> bool:
    """Whether the file is there with the bytes that the manifest vouches for."""
    return has_size(folder, entry) and sha256_file(folder / entry.file) == entry.sha256


def has_size(folder: Path, entry: ShardEntry) -> bool:
    """Whether the file is there with as many bytes as the manifest says."""
    path = folder / entry.file
    return path.is_file() and path.stat().st_size == entry.bytes


def read_sidecar(
    folder: Path, entry: ShardEntry, parameters: dict[str, Any], count: int
) -> NDArray[Any]:
    """A row for each of `count` objects, from a file that is whole: `colour` (v, COLOUR_BINS) and
    `pairs` (v, PAIR_BINS) uint8, `sizes` (r, 3) float32, NaN where an object has fewer poses.

    Errors: PriorError.
    """
    path = folder / entry.file
    try:
        table = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError) as error:
        raise damaged(path, error) from error
    if table.dtype != row_type(parameters) or len(table) != count:
        raise damaged(path, f"{table.dtype}, {table.shape}")
    return np.asanyarray(table)


def restore_sidecar(folder: Path, manifest: Manifest) -> NDArray[Any]:
    """The same where the file is missing or damaged: it is made again; in memory, where the folder
    cannot be written. Errors: PriorError if the shards have other descriptors than the manifest
    says."""
    entry = manifest.appearance
    path = folder / entry.file
    log.warning("%s is missing or damaged; it is made again from the shards", path)
    try:
        made = write_sidecar(folder, manifest.objects, manifest.parameters)
    except OutputError:
        rows = _rows(row_type(manifest.parameters), folder, manifest.objects, {})
        return np.stack(list(rows))
    if made != entry:
        raise damaged(path, "descriptors that are not those that the manifest vouches for")
    return read_sidecar(folder, entry, manifest.parameters, len(manifest.objects))


def row_type(parameters: dict[str, Any]) -> np.dtype[Any]:
    """What a row holds. Errors: PriorError if the parameters do not tell."""
    try:
        views = int(parameters["appearance"]["views"])
        poses = int(parameters["poses"]["max_count"])
        if not (0 < views <= _MOST and 0 < poses <= _MOST):
            raise ValueError(f"{views} views, {poses} poses")
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise PriorError(
            "The prior's manifest does not say how its objects were looked at",
            found=trouble_of(error),
            fix="run brrp build-prior again",
        ) from error
    return np.dtype(
        [
            ("colour", "|u1", (views, COLOUR_BINS)),
            ("pairs", "|u1", (views, PAIR_BINS)),
            ("sizes", "<f4", (poses, 3)),
        ]
    )


def _rows(
    kind: np.dtype[Any], folder: Path, objects: Sequence[ObjectEntry], kept: Rows
) -> Iterator[Any]:
    """A row () for each object; a shard is opened once, since it holds a run of names, and only for
    rows that are not `kept`."""
    for file, members in groupby(objects, key=lambda entry: entry.shard):
        entries = list(members)
        new = [entry.name for entry in entries if (entry.name, entry.input_sha256) not in kept]
        read = _from_shard(folder / file, new) if new else {}
        for entry in entries:
            if entry.name in read:
                yield _row(kind, folder, read[entry.name])
            else:
                yield kept[entry.name, entry.input_sha256]


def _row(kind: np.dtype[Any], folder: Path, found: Appearance) -> NDArray[Any]:
    row = np.zeros((), kind)
    poses = len(found.sizes)
    if len(found.colour) != len(row["colour"]) or poses > len(row["sizes"]):
        raise damaged(folder, "shards with more or fewer views than the manifest tells")
    row["colour"] = found.colour
    row["pairs"] = found.pairs
    row["sizes"] = np.nan
    row["sizes"][:poses] = found.sizes
    return row


def _from_shard(path: Path, names: Sequence[str]) -> dict[str, Appearance]:
    with open_shard(path) as shard:
        return {name: read_appearance(shard, name) for name in names}
