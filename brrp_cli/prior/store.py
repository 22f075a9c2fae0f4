"""A prior on disk: look up, load, verify."""

from __future__ import annotations

import hashlib
import os
from collections import OrderedDict, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby
from pathlib import Path
from threading import Lock
from typing import Any

from numpy.typing import NDArray

from brrp_cli.errors import BrrpError, PriorError
from brrp_cli.files import sha256_file
from brrp_cli.prior.appearance_file import is_whole
from brrp_cli.prior.appearance_index import AppearanceIndex, open_appearance_index
from brrp_cli.prior.index import Index, read_index
from brrp_cli.prior.manifest import (
    FILE,
    Manifest,
    ObjectEntry,
    ShardEntry,
    parse_manifest,
    read_bytes,
)
from brrp_cli.prior.objects import PriorObject
from brrp_cli.prior.pack import unpack
from brrp_cli.prior.shard import damaged, object_names, open_shard, read_parts, read_stored

# Objects that are held in memory once they were read, about 2 MB each.
HELD = 64


@dataclass
class Prior:
    """A prior, opened to read. Shards are read when an object is asked for, and checked against
    the manifest's sha256 before the first byte of theirs is used. The `HELD` objects that were
    asked for last are held."""

    path: Path
    index: Index
    _checked: set[str] = field(default_factory=set, repr=False)
    _held: OrderedDict[str, PriorObject] = field(default_factory=OrderedDict, repr=False)
    _reading: Lock = field(default_factory=Lock, repr=False, compare=False)

    @cached_property
    def manifest(self) -> Manifest:
        """All that is known of the objects. Errors: PriorError, also if it is another one by now
        than that which was opened."""
        data = read_bytes(self.path)
        if hashlib.sha256(data).hexdigest() != self.digest:
            raise PriorError(
                "The prior was built again meanwhile", where=self.path, fix="open the prior again"
            )
        return parse_manifest(data, self.path / FILE)

    @property
    def names(self) -> list[str]:
        """Names of the objects, sorted."""
        return self.index.names

    @property
    def phrases(self) -> list[str]:
        """Phrases for CLIP, in the order of the names."""
        return self.index.descriptions

    @cached_property
    def descriptions(self) -> dict[str, str]:
        """Name -> phrase for CLIP."""
        return dict(zip(self.names, self.phrases, strict=True))

    @cached_property
    def entries(self) -> dict[str, ObjectEntry]:
        """Name -> what the manifest says of the object."""
        return {entry.name: entry for entry in self.manifest.objects}

    @property
    def parameters(self) -> dict[str, Any]:
        """What the prior was built with: seed, samples, mix, features, ..."""
        return self.index.parameters

    @cached_property
    def appearance(self) -> AppearanceIndex:
        """What the objects look like, a row for each name (see appearance_index.py). Errors:
        PriorError."""
        return open_appearance_index(self.path, self.index, lambda: self.manifest)

    @property
    def digest(self) -> str:
        """sha256 of the manifest, and with it of all that it vouches for."""
        return self.index.digest

    def load(self, name: str) -> PriorObject:
        """One object, not to be changed. Errors: KeyError for an unknown name, PriorError for a bad
        shard."""
        with self._reading:
            found = self._held.pop(name, None) or self._read(name)
            self._held[name] = found
            if len(self._held) > HELD:
                self._held.popitem(last=False)
            return found

    @property
    def held(self) -> list[PriorObject]:
        """The objects that are held at the moment."""
        with self._reading:
            return list(self._held.values())

    def parts(
        self, names: Sequence[str], keys: Sequence[str]
    ) -> Iterator[tuple[str, dict[str, NDArray[Any]]]]:
        """Some arrays (shard.py names them) of some objects, shard by shard; they are not held.
        Errors: KeyError for an unknown name, PriorError for a bad shard."""
        by_shard = sorted(names, key=lambda name: self.index.shard_of[self.index.rows[name]])
        for number, group in groupby(
            by_shard, lambda name: self.index.shard_of[self.index.rows[name]]
        ):
            shard = self.index.shards[number]
            with self._reading:
                self._check(shard)
            with open_shard(self.path / shard.file) as file:
                for name in group:
                    yield name, read_parts(file, name, keys)

    def _check(self, shard: ShardEntry) -> None:
        if shard.file not in self._checked:
            check_bytes(self.path, shard)
            self._checked.add(shard.file)

    def _read(self, name: str) -> PriorObject:
        row = self.index.rows[name]
        shard = self.index.shards[self.index.shard_of[row]]
        self._check(shard)
        with open_shard(self.path / shard.file) as file:
            return unpack(read_stored(file, name), self.phrases[row])


def open_prior(path: str | Path) -> Prior:
    """Open the prior in a folder. Errors: PriorError."""
    if not isinstance(path, (str, os.PathLike)):
        raise PriorError(
            "That is no path of a prior",
            expected="the folder of a prior",
            found=repr(path),
            fix='open_prior("prior/"); brrp build-prior makes one',
        )
    folder = Path(path)
    return Prior(folder, read_index(folder))


def check_bytes(folder: Path, shard: ShardEntry) -> None:
    """PriorError unless the file is there and has the manifest's sha256."""
    path = folder / shard.file
    if not path.is_file():
        with open_shard(path):
            pass
    size = path.stat().st_size
    if size != shard.bytes:
        raise damaged(path, f"{size} bytes in place of {shard.bytes}")
    if sha256_file(path) != shard.sha256:
        raise damaged(path, "bytes that do not have the manifest's sha256")


def verify_prior(prior: Prior) -> list[str]:
    """Read everything; one line for each problem, none if all is well."""
    problems = []
    members: defaultdict[str, dict[str, ObjectEntry]] = defaultdict(dict)
    for entry in prior.manifest.objects:
        members[entry.shard][entry.name] = entry
    for shard in prior.manifest.shards:
        entries = members[shard.file]
        try:
            check_bytes(prior.path, shard)
            with open_shard(prior.path / shard.file) as file:
                if object_names(file) != sorted(entries):
                    raise damaged(shard.file, "other objects than the manifest lists")
                for name, entry in entries.items():
                    stored = read_stored(file, name)
                    if stored.input_sha256 != entry.input_sha256 or stored.record != entry.record:
                        raise damaged(f"{shard.file}, {name}", "not what the manifest tells of it")
        except BrrpError as error:
            problems.append(f"{shard.file}: {error.what}: {error.found or 'not there'}")
    sidecar = prior.manifest.appearance
    if not is_whole(prior.path, sidecar):
        problems.append(f"{sidecar.file}: Missing or damaged; the next retrieval makes it again")
    listed = {shard.file for shard in prior.manifest.shards}
    for path in sorted((prior.path / "shards").glob("*.h5")):
        if f"shards/{path.name}" not in listed:
            problems.append(f"shards/{path.name}: A shard that the manifest does not list")
    return problems
