"""manifest.json: what a prior consists of. It is written last; it is the commit.

Keys: kind, schema, parameters, objects (sorted by name; each with name, description, source,
input_sha256, shard, half_extent, record), shards (file, sha256, bytes), appearance (file, sha256,
bytes; see appearance_file.py), failed (name, source, reason), libraries (versions that the objects
were made with), content_sha256 (of the file's bytes with zeros in its place). No times and no
absolute paths: the same seed and meshes give the same bytes. Each object and shard has a line.
"""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

from brrp_cli.errors import PriorError
from brrp_cli.files import parse_json, trouble_of, write_bytes
from brrp_cli.prior.names import APPEARANCE_NAME, SHARD_NAME, safe_name

SCHEMA = 2
KIND = "brrp-prior"
FILE = "manifest.json"
# 50,000 objects take 75 MB.
MAX_BYTES = 2**30
# A shard of 16 objects with a million samples each takes 300 MB.
MAX_SHARD_BYTES = 2**31
_NOTHING = 64 * "0"
# Of the top level alone, as `as_bytes` sets it.
_OWN_SUM = re.compile(rb'\n "content_sha256": "([0-9a-f]{64})"')
_SHA256 = re.compile(r"[0-9a-f]{64}")


class ForeignManifestError(PriorError):
    """The manifest is not ours to replace: a newer brrp wrote it, or another program."""


@dataclass(frozen=True)
class ObjectEntry:
    """One object: where it came from, where it lies, how it was made."""

    name: str
    description: str
    source: str
    input_sha256: str
    shard: str
    record: dict[str, Any]


@dataclass(frozen=True)
class ShardEntry:
    """One shard. `file` is relative to the prior."""

    file: str
    sha256: str
    bytes: int


@dataclass(frozen=True)
class Failure:
    """A mesh that could not become an object."""

    name: str
    source: str
    reason: str


@dataclass(frozen=True)
class Manifest:
    """The whole of it."""

    parameters: dict[str, Any]
    objects: list[ObjectEntry]
    shards: list[ShardEntry]
    failed: list[Failure]
    appearance: ShardEntry

    def as_bytes(self) -> bytes:
        """The file's bytes."""
        return with_own_sum(
            {
                "kind": KIND,
                "schema": SCHEMA,
                "parameters": self.parameters,
                "libraries": self.libraries,
                "objects": [vars(entry) for entry in self.objects],
                "shards": [vars(entry) for entry in self.shards],
                "failed": [vars(entry) for entry in self.failed],
                "appearance": vars(self.appearance),
            }
        )

    @property
    def libraries(self) -> dict[str, list[str]]:
        """Library -> versions that the objects were made with."""
        met: dict[str, set[str]] = {}
        for entry in self.objects:
            for library, version in entry.record.get("made_with", {}).items():
                met.setdefault(library, set()).add(version)
        return {library: sorted(versions) for library, versions in sorted(met.items())}


def with_own_sum(table: dict[str, Any]) -> bytes:
    """The bytes of a manifest with these keys and its `content_sha256`."""
    table = table | {"content_sha256": _NOTHING}
    keys = [f' "{key}": {_value(table[key])}' for key in sorted(table)]
    text = "{\n" + ",\n".join(keys) + "\n}\n"
    key = '\n "content_sha256": "'
    return text.replace(key + _NOTHING, key + _sum(text.encode()), 1).encode()


def _value(value: Any) -> str:
    """JSON; a line for each item of a list. Python indents ten times more slowly than it writes."""
    if isinstance(value, list) and value:
        return "[\n  " + ",\n  ".join(map(_line, value)) + "\n ]"
    return _line(value)


def _line(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, sort_keys=True)


def write_manifest(folder: Path, manifest: Manifest) -> str:
    """Commit, unless just this manifest stands there already; the sha256 of its bytes."""
    data = manifest.as_bytes()
    path = folder / FILE
    if not (path.is_file() and path.stat().st_size == len(data) and path.read_bytes() == data):
        write_bytes(path, data)
    return _sum(data)


def read_manifest(folder: Path) -> Manifest:
    """Read and check. Errors: PriorError for a folder that is no prior, a manifest that cannot be
    read, is of a newer schema, or names a file outside of the prior."""
    return parse_manifest(read_bytes(folder), folder / FILE)


def read_bytes(folder: Path) -> bytes:
    """The manifest's bytes. Errors: PriorError for a folder that is no prior, or a manifest that
    cannot be read or is far too large."""
    path = folder / FILE
    if not path.is_file():
        raise PriorError(
            "No prior here",
            where=folder,
            expected=f"a folder with {FILE}",
            fix="make one: brrp build-prior MESHES/ -o PRIOR/",
        )
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise ValueError(f"{size} bytes, at most {MAX_BYTES} are read")
        return path.read_bytes()
    except (OSError, ValueError) as error:
        raise _unusable(path, error) from error


def parse_manifest(data: bytes, path: Path) -> Manifest:
    """The manifest with these bytes, checked; `path` is for messages. Errors: PriorError."""
    try:
        table = parse_json(data.decode("utf-8"))
        _refuse_foreign(table, path)
        _check_sum(data)
        manifest = Manifest(
            parameters=dict(table["parameters"]),
            objects=[ObjectEntry(**entry) for entry in table["objects"]],
            shards=[ShardEntry(**entry) for entry in table["shards"]],
            failed=[Failure(**entry) for entry in table["failed"]],
            appearance=ShardEntry(**table["appearance"]),
        )
        _check_text(manifest)
        check_files(manifest.shards, manifest.appearance)
        _check_objects(manifest)
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError) as error:
        raise _unusable(path, error) from error
    return manifest


def _sum(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _check_sum(data: bytes) -> None:
    """ValueError if the manifest states no sum, or one that it does not have."""
    told = _OWN_SUM.search(data)
    if told is None:
        raise ValueError("no content_sha256")
    start, end = told.span(1)
    if _sum(data[:start] + _NOTHING.encode() + data[end:]) != told[1].decode():
        raise ValueError("bytes that do not have the manifest's own sha256")


def _unusable(path: Path, error: Exception) -> PriorError:
    return PriorError(
        "The prior's manifest cannot be used",
        where=path,
        found=trouble_of(error),
        fix="restore the file, or run brrp build-prior again; finished shards are kept",
    )


def _refuse_foreign(table: dict[str, Any], path: Path) -> None:
    if table.get("kind") != KIND:
        raise ForeignManifestError(
            "The manifest there is not that of a prior",
            where=path,
            expected=f"kind {KIND}",
            found=f"kind {table.get('kind')}",
        )
    if int(table["schema"]) > SCHEMA:
        raise ForeignManifestError(
            "The prior was written by a newer brrp",
            where=path,
            expected=f"schema {SCHEMA}",
            found=f"schema {table['schema']}",
            fix="pip install --upgrade brrp-cli",
        )


def check_files(shards: list[ShardEntry], appearance: ShardEntry) -> None:
    """ValueError for a file that is not where and how a prior keeps its files."""
    for shard in shards:
        if not SHARD_NAME.fullmatch(shard.file):
            raise ValueError(f"a shard named {shard.file!r}")
    if not APPEARANCE_NAME.fullmatch(appearance.file):
        raise ValueError(f"a file of descriptors named {appearance.file!r}")
    for entry in [*shards, appearance]:
        if not _SHA256.fullmatch(entry.sha256):
            raise ValueError(f"{entry.file} with the sum {entry.sha256!r}")
        if type(entry.bytes) is not int or not 0 <= entry.bytes <= MAX_SHARD_BYTES:
            raise ValueError(f"{entry.file} of {entry.bytes!r} bytes")


def _check_text(manifest: Manifest) -> None:
    """TypeError unless what is text is text, and records are tables; ValueError for a name that
    would lead elsewhere in a shard or in a file system."""
    for entry in manifest.objects:
        texts = (entry.name, entry.description, entry.source, entry.input_sha256, entry.shard)
        if not all(isinstance(text, str) for text in texts) or not isinstance(entry.record, dict):
            raise TypeError(f"an object of other types: {entry.name!r}")
        if safe_name(entry.name) != entry.name:
            raise ValueError(f"an object named {entry.name!r}")
        made_with = entry.record.get("made_with", {})
        if not isinstance(made_with, dict) or not all(
            isinstance(version, str) for version in made_with.values()
        ):
            raise TypeError(f"{entry.name} made with {made_with!r}")
    for failure in manifest.failed:
        if not all(isinstance(text, str) for text in astuple(failure)):
            raise TypeError(f"a failure of other types: {failure.name!r}")


def _check_objects(manifest: Manifest) -> None:
    names = {entry.name for entry in manifest.objects}
    if len(names) < len(manifest.objects):
        raise ValueError("an object that stands there twice")
    files = {shard.file for shard in manifest.shards}
    for entry in manifest.objects:
        if entry.shard not in files:
            raise ValueError(f"{entry.name} lies in {entry.shard!r}, which is not listed")
