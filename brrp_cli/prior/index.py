"""What every start needs of a manifest, in columns: read in milliseconds, however many objects.

`manifest.index` lies beside manifest.json and holds nothing that the manifest does not: where it is
missing, damaged, or of another manifest, it is made again, in memory where the folder cannot be
written. Its first line is the sha256 of the second, a JSON table: schema, digest (sha256 of the
manifest's bytes), parameters, appearance, shards (rows of file, sha256, bytes), and for each
object, in the order of the manifest, names, descriptions, shard_of (row of its shard).
"""

from __future__ import annotations

import hashlib
import json
import logging
from dataclasses import asdict, astuple, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from brrp_cli.errors import OutputError
from brrp_cli.files import parse_json, sha256_file, write_bytes
from brrp_cli.prior.manifest import (
    FILE,
    MAX_BYTES,
    Manifest,
    ShardEntry,
    check_files,
    parse_manifest,
    read_bytes,
)

SCHEMA = 1
INDEX_FILE = "manifest.index"

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Index:
    """See above. `digest` names this prior and no other."""

    digest: str
    parameters: dict[str, Any]
    appearance: ShardEntry
    shards: list[ShardEntry]
    names: list[str]
    descriptions: list[str]
    shard_of: list[int]

    @cached_property
    def rows(self) -> dict[str, int]:
        """Name -> its row."""
        return {name: row for row, name in enumerate(self.names)}

    def as_bytes(self) -> bytes:
        """The file's bytes."""
        table = {
            "schema": SCHEMA,
            "digest": self.digest,
            "parameters": self.parameters,
            "appearance": asdict(self.appearance),
            "shards": [astuple(shard) for shard in self.shards],
            "names": self.names,
            "descriptions": self.descriptions,
            "shard_of": self.shard_of,
        }
        line = json.dumps(table, separators=(",", ":"), sort_keys=True).encode()
        return hashlib.sha256(line).hexdigest().encode() + b"\n" + line + b"\n"


def index_of(manifest: Manifest, digest: str) -> Index:
    """The columns of a manifest that was checked; digest : sha256 of its bytes."""
    row_of = {shard.file: row for row, shard in enumerate(manifest.shards)}
    return Index(
        digest=digest,
        parameters=manifest.parameters,
        appearance=manifest.appearance,
        shards=manifest.shards,
        names=[entry.name for entry in manifest.objects],
        descriptions=[entry.description for entry in manifest.objects],
        shard_of=[row_of[entry.shard] for entry in manifest.objects],
    )


def write_index(folder: Path, index: Index) -> None:
    """Keep the index, unless it stands there already, or the folder cannot be written: nothing but
    time is lost then."""
    data, path = index.as_bytes(), folder / INDEX_FILE
    try:
        if not (path.is_file() and path.read_bytes() == data):
            write_bytes(path, data)
    except OSError as error:
        log.info("%s cannot be read: %s", path, error.strerror)
    except OutputError as error:
        log.info("%s cannot be kept: %s", folder / INDEX_FILE, error.found)


def read_index(folder: Path) -> Index:
    """The index of the prior in a folder, from its file or from the manifest itself.

    Errors: PriorError, as of read_manifest.
    """
    kept = _kept(folder)
    if kept is not None:
        return kept
    data = read_bytes(folder)
    index = index_of(parse_manifest(data, folder / FILE), hashlib.sha256(data).hexdigest())
    write_index(folder, index)
    return index


def _kept(folder: Path) -> Index | None:
    """What the file says, if it is whole and of the manifest that stands there."""
    try:
        checksum, line, _ = (folder / INDEX_FILE).read_bytes().split(b"\n")
        if hashlib.sha256(line).hexdigest().encode() != checksum:
            return None
        table = parse_json(line)
        if table.pop("schema") != SCHEMA or (folder / FILE).stat().st_size > MAX_BYTES:
            return None
        if table["digest"] != sha256_file(folder / FILE):
            return None
        appearance = ShardEntry(**table.pop("appearance"))
        shards = [ShardEntry(*row) for row in table.pop("shards")]
        index = Index(appearance=appearance, shards=shards, **table)
        check_files(index.shards, index.appearance)
        _check_columns(index)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    return index


def _check_columns(index: Index) -> None:
    """ValueError unless the columns are of one length and lead to shards that are there."""
    count = len(index.names)
    if not count == len(index.descriptions) == len(index.shard_of):
        raise ValueError("columns of different lengths")
    if count and not 0 <= min(index.shard_of) <= max(index.shard_of) < len(index.shards):
        raise ValueError("an object in a shard that is not there")
