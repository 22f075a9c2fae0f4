"""Make a prior of many objects out of one of few, to time what a prior's size costs.

    python tools/copy_prior.py --prior prior/ --objects 50000 -o many/

The objects of `prior` stay as they are. Copies have names and entries in the manifest of their
own, lie in the shards in which a build would put them, so that `brrp prior add` can be timed too,
and have descriptors that are mixed in pairs and stretched, so that no two are alike; all else of
a copy is what its original has, to the byte. With --strange the histograms are shuffled besides,
so that next to none of the copies is retrieved. Only manifest and descriptors take room on the
disk: in a shard, every name of a copy is a hard link to its original, and so are shards of the
same originals, which hold the names of all their copies. That is the one difference from a built
prior, and `brrp verify` tells of it.
"""

from __future__ import annotations

import os
import sys
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message

from brrp_cli.errors import PriorError
from brrp_cli.files import atomic_folder, sha256_file
from brrp_cli.prior.appearance_file import sidecar_file
from brrp_cli.prior.appearance_index import open_appearance_index
from brrp_cli.prior.build.shard_plan import plan_shards, shard_file
from brrp_cli.prior.index import read_index
from brrp_cli.prior.manifest import (
    FILE,
    ObjectEntry,
    ShardEntry,
    read_manifest,
    write_manifest,
)
from brrp_cli.prior.store import Prior, open_prior

CHUNK = 1_000


@click.command()
@click.option("--prior", "prior_path", required=True, type=click.Path(path_type=Path))
@click.option("--objects", default=50_000, show_default=True, type=click.IntRange(1))
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path))
@click.option("--strange", is_flag=True, help="Copies that look like nothing that is there.")
@click.option("--overwrite", is_flag=True)
@one_message()
def main(prior_path: Path, objects: int, output: Path, strange: bool, overwrite: bool) -> None:
    """Make a prior of so many OBJECTS in the folder OUTPUT."""
    prior = open_prior(prior_path)
    if objects < len(prior.names):
        raise PriorError(
            "The prior cannot be copied",
            where=prior_path,
            expected=f"at most {objects} objects",
            found=f"{len(prior.names)} objects",
        )
    with atomic_folder(output, overwrite=overwrite, mark=FILE) as folder:
        copy_prior(prior, objects, folder, strange)
    size = (output / FILE).stat().st_size / 1e6
    click.echo(f"{objects} objects, a manifest of {size:.1f} MB: {output}/")


def copy_prior(prior: Prior, count: int, folder: Path, strange: bool) -> None:
    """Write all of it into an empty folder."""
    manifest = prior.manifest
    (folder / "shards").mkdir()
    copies = islice(_copies(manifest.objects), count - len(manifest.objects))
    pairs = [*((entry, entry) for entry in manifest.objects), *copies]
    objects, shards = _place(sorted(pairs, key=lambda pair: pair[0].name), prior, folder)
    rows = {name: row for row, name in enumerate(prior.names)}
    file = sidecar_file(objects, prior.parameters)
    write_rows(
        folder / file,
        prior.appearance.rows(np.arange(len(prior.names))),
        np.array([rows[entry.name.split(".copy-")[0]] for entry in objects]),
        np.array([entry.name not in rows for entry in objects]),
        strange,
    )
    path = folder / file
    write_manifest(
        folder,
        replace(
            manifest,
            objects=objects,
            shards=sorted(shards, key=lambda entry: entry.file),
            appearance=ShardEntry(file, sha256_file(path), path.stat().st_size),
        ),
    )
    # What a build leaves too.
    open_appearance_index(folder, read_index(folder), lambda: read_manifest(folder))


def _copies(objects: list[ObjectEntry]) -> Iterator[tuple[ObjectEntry, ObjectEntry]]:
    """(copy, original) without end, all originals in turn."""
    number = 0
    while True:
        number += 1
        for entry in objects:
            yield replace(entry, name=f"{entry.name}.copy-{number:05d}"), entry


def _place(
    pairs: list[tuple[ObjectEntry, ObjectEntry]], prior: Prior, folder: Path
) -> tuple[list[ObjectEntry], list[ShardEntry]]:
    """(object, original), sorted, each in its shard, and those shards."""
    names_of: defaultdict[str, list[str]] = defaultdict(list)
    for item, original in pairs:
        names_of[original.name].append(item.name)
    by_name = {item.name: (item, original) for item, original in pairs}
    groups: defaultdict[tuple[str, ...], list[list[ObjectEntry]]] = defaultdict(list)
    for names in plan_shards(list(by_name)):
        originals = sorted({by_name[name][1].name for name in names})
        groups[tuple(originals)].append([by_name[name][0] for name in names])
    placed, shards = [], []
    for originals, members in groups.items():
        base = folder / "shards" / "base.h5"
        _write_base(base, [(prior.entries[name], names_of[name]) for name in originals], prior)
        sha256, size = sha256_file(base), base.stat().st_size
        for run in members:
            file = shard_file(prior.parameters, [(item.name, item.input_sha256) for item in run])
            os.link(base, folder / file)
            shards.append(ShardEntry(file, sha256, size))
            placed += [replace(item, shard=file) for item in run]
        base.unlink()
    return sorted(placed, key=lambda entry: entry.name), shards


def _write_base(path: Path, contents: list[tuple[ObjectEntry, list[str]]], prior: Prior) -> None:
    """A shard of these objects, each under each of its names."""
    import h5py

    with h5py.File(path, "w") as base:
        group = base.create_group("objects")
        for entry, names in contents:
            with h5py.File(prior.path / entry.shard) as source:
                base.attrs.update(source.attrs)
                source.copy(f"objects/{entry.name}", group)
            for name in names:
                if name != entry.name:
                    group[name] = group[entry.name]


def write_rows(
    path: Path,
    source: NDArray[Any],
    rows: NDArray[np.int64],
    mixed: NDArray[np.bool_],
    strange: bool,
) -> None:
    """source[rows] (n,); those of `mixed` (n,) are mixed with another and stretched,
    and their bins shuffled if `strange`."""
    rng = np.random.default_rng(0)
    table = np.lib.format.open_memmap(path, mode="w+", dtype=source.dtype, shape=rows.shape)
    for start in range(0, len(rows), CHUNK):
        here = slice(start, start + CHUNK)
        one = source[rows[here]]
        two = source[rng.integers(len(source), size=len(one))]
        share = rng.random((len(one), 1, 1))
        made = one.copy()
        for field in ("colour", "pairs"):
            squares = (
                share * one[field].astype(float) ** 2 + (1 - share) * two[field].astype(float) ** 2
            )
            made[field] = np.rint(np.sqrt(squares))
            if strange:
                made[field] = rng.permuted(made[field], axis=-1)
        made["sizes"] = one["sizes"] * rng.uniform(0.5, 1.5, (len(one), 1, 3))
        table[here] = np.where(mixed[here], made, one)
    table.flush()


if __name__ == "__main__":
    main()
