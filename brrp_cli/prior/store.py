"""A prior on disk: look up, load, verify."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from brrp_cli.errors import BrrpError
from brrp_cli.files import sha256_file
from brrp_cli.prior.manifest import Manifest, ObjectEntry, ShardEntry, read_manifest
from brrp_cli.prior.objects import PriorObject
from brrp_cli.prior.pack import unpack
from brrp_cli.prior.shard import damaged, object_names, open_shard, read_stored
from brrp_cli.prior.sidecar import is_whole, read_sidecar


@dataclass
class Prior:
    """A prior, opened to read. Shards are read when an object is asked for, and checked against
    the manifest's sha256 before the first byte of theirs is used."""

    path: Path
    manifest: Manifest
    _checked: set[str] = field(default_factory=set, repr=False)

    @property
    def names(self) -> list[str]:
        """Names of the objects, sorted."""
        return [entry.name for entry in self.manifest.objects]

    @property
    def descriptions(self) -> dict[str, str]:
        """Name -> phrase for CLIP."""
        return {entry.name: entry.description for entry in self.manifest.objects}

    @property
    def entries(self) -> dict[str, ObjectEntry]:
        """Name -> what the manifest says of the object."""
        return {entry.name: entry for entry in self.manifest.objects}

    @property
    def parameters(self) -> dict[str, Any]:
        """What the prior was built with: seed, samples, mix, features, ..."""
        return self.manifest.parameters

    @cached_property
    def appearance(self) -> NDArray[Any] | None:
        """A row of descriptors for each name (see sidecar.py), mapped into memory; None in a prior
        of an older brrp. Errors: PriorError."""
        return read_sidecar(self.path, self.manifest)

    @property
    def digest(self) -> str:
        """sha256 that names this prior and no other."""
        return self.manifest.digest

    def load(self, name: str) -> PriorObject:
        """Read one object. Errors: KeyError for an unknown name, PriorError for a bad shard."""
        entry = self.entries[name]
        if entry.shard not in self._checked:
            shard = next(s for s in self.manifest.shards if s.file == entry.shard)
            check_bytes(self.path, shard)
            self._checked.add(entry.shard)
        with open_shard(self.path / entry.shard) as file:
            return unpack(read_stored(file, name), entry.description)


def open_prior(path: str | Path) -> Prior:
    """Open the prior in a folder. Errors: PriorError."""
    folder = Path(path)
    return Prior(folder, read_manifest(folder))


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
    for shard in prior.manifest.shards:
        entries = {e.name: e for e in prior.manifest.objects if e.shard == shard.file}
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
    if sidecar is not None and not is_whole(prior.path, sidecar):
        problems.append(f"{sidecar.file}: Missing or damaged; the next retrieval makes it again")
    listed = {shard.file for shard in prior.manifest.shards}
    for path in sorted((prior.path / "shards").glob("*.h5")):
        if f"shards/{path.name}" not in listed:
            problems.append(f"shards/{path.name}: A shard that the manifest does not list")
    return problems
