"""A prior as a brrp without appearance and distances built it."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

from brrp_cli.files import sha256_file
from brrp_cli.prior.manifest import read_manifest, write_manifest
from brrp_cli.prior.shard import object_names, open_shard, read_stored, write_shard

LATER = ("appearance", "distances")


def older_prior(prior: Path, folder: Path) -> Path:
    """A whole copy of `prior` in `folder` with neither, vouched for by its manifest."""
    shutil.copytree(prior, folder)
    manifest = read_manifest(folder)
    shards = []
    for shard in manifest.shards:
        path = folder / shard.file
        with open_shard(path) as file:
            objects = [read_stored(file, name) for name in object_names(file)]
        kept = [
            replace(o, arrays={k: v for k, v in o.arrays.items() if not k.startswith(LATER)})
            for o in objects
        ]
        write_shard(path, kept, {})
        shards.append(replace(shard, sha256=sha256_file(path), bytes=path.stat().st_size))
    if manifest.appearance is not None:
        (folder / manifest.appearance.file).unlink()
    parameters = {k: v for k, v in manifest.parameters.items() if k not in LATER}
    write_manifest(folder, replace(manifest, parameters=parameters, shards=shards, appearance=None))
    return folder
