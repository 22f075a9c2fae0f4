"""What an earlier run has finished already and this one can take over."""

from __future__ import annotations

import logging
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from brrp_cli.errors import PriorError
from brrp_cli.files import parse_json
from brrp_cli.prior.manifest import Manifest, ObjectEntry
from brrp_cli.prior.shard import object_names, open_shard, read_stored
from brrp_cli.prior.store import check_bytes

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Finished:
    """A finished object: its shard, relative to the prior, and its record. `folder`: of the prior
    where it lies, if that is another one than the prior that is made."""

    shard: str
    record: dict[str, Any]
    folder: Path | None = None

    @property
    def place(self) -> tuple[Path | None, str]:
        """Folder and shard."""
        return self.folder, self.shard


Reusable = dict[tuple[str, str], Finished]


def reusable_objects(
    folder: Path, manifest: Manifest | None, parameters: dict[str, Any]
) -> Reusable:
    """(name, input_sha256) -> Finished, for all objects made with these parameters.

    Shards that the manifest lists are checked against its sha256. Others, which a run left that
    was killed before it could write the manifest, are read and checked object by object. Damaged
    shards are noted and left out, so that their objects are made again.
    """
    stock: Reusable = {}
    listed = set()
    if manifest is not None and manifest.parameters == parameters:
        members: defaultdict[str, list[ObjectEntry]] = defaultdict(list)
        for entry in manifest.objects:
            members[entry.shard].append(entry)
        for shard in manifest.shards:
            listed.add(shard.file)
            try:
                check_bytes(folder, shard)
            except PriorError as error:
                log.warning("%s: %s; its objects are made again", shard.file, error.what)
                continue
            for entry in members[shard.file]:
                stock[entry.name, entry.input_sha256] = Finished(shard.file, entry.record)
    for key, finished in unlisted_objects(folder, listed, parameters).items():
        stock.setdefault(key, finished)
    return stock


def unlisted_objects(folder: Path, listed: set[str], parameters: dict[str, Any]) -> Reusable:
    """The objects in shards that a run left which was killed before it could write the manifest:
    made with these parameters, read and checked one by one. listed : shards to pass over."""
    stock: Reusable = {}
    for path in sorted((folder / "shards").glob("shard-*.h5")):
        file = f"shards/{path.name}"
        if file not in listed:
            try:
                for key, finished in _unlisted(path, file, parameters).items():
                    stock.setdefault(key, finished)
            except PriorError as error:
                log.warning("%s: %s; its objects are made again", file, error.what)
    return stock


def _unlisted(path: Path, file: str, parameters: dict[str, Any]) -> Reusable:
    with open_shard(path) as shard:
        if parse_json(shard.attrs["parameters"]) != parameters:
            return {}
        found = [read_stored(shard, name) for name in object_names(shard)]
    return {(s.name, s.input_sha256): Finished(file, s.record) for s in found}
