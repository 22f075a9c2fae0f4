"""Sets of meshes that brrp fetches: `data_manifests/NAME_meshes.toml`."""

from __future__ import annotations

import tomllib
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

from brrp_cli.fetch.archive import fetch_archive, find_archive, is_complete
from brrp_cli.fetch.fetch import RemoteFile, fetch, is_address, only_fetch
from brrp_cli.progress import progress

FOLDER = Path(__file__).parents[1] / "data_manifests"


@dataclass(frozen=True)
class MeshSet:
    """Files of meshes that belong together.

    archive : where a source has the files NAME/... in one archive, as a pattern with {name}; empty
    where it has them one by one. instead : (end of a path, the file that may stand in its place).
    """

    title: str
    licence: str
    address: str
    files: list[RemoteFile]
    archive: str = ""
    instead: tuple[tuple[str, RemoteFile], ...] = ()


def read_mesh_set(name: str) -> MeshSet:
    """The set of that name that the package brings."""
    table = tomllib.loads((FOLDER / f"{name}_meshes.toml").read_text(encoding="utf-8"))
    remote = table.get("remote", "")
    return MeshSet(
        title=table["title"],
        licence=table["licence"],
        address=table["address"],
        files=[
            RemoteFile(**entry, remote=remote.format(stem=Path(path).stem, path=path))
            for entry in table["files"]
            for path in [entry["path"]]
        ],
        archive=table.get("archive", ""),
        instead=tuple(
            (entry["path"], RemoteFile(**{"bytes": 0, "sha256": "", **entry["by"]}))
            for entry in table.get("instead", [])
        ),
    )


@dataclass(frozen=True)
class Fetched:
    """brought : paths of files that were not there; unchecked : those of them without a known
    sum."""

    brought: list[str]
    unchecked: list[str]


def fetch_meshes(meshes: MeshSet, source: str | None, folder: Path) -> Fetched:
    """Make `folder` hold the set. Errors: FetchError, OutputError, as of fetch().

    source : base of addresses or folder; a folder holds the files as `folder` will, or as the set's
    own address does. None: that address.
    """
    source = source or meshes.address
    if not meshes.archive:
        return Fetched(fetch(meshes.files, source, folder, label="meshes"), [])
    groups: defaultdict[str, list[RemoteFile]] = defaultdict(list)
    for file in meshes.files:
        groups[file.path.split("/")[0]].append(file)
    brought, unchecked, loose = [], [], []
    with only_fetch(folder):
        todo = {
            name: files
            for name, files in groups.items()
            if not any(is_complete(folder, choice) for choice in _choices(meshes, files))
        }
        for name, files in progress(todo.items(), "archives", len(todo)):
            archive = meshes.archive.format(name=name)
            if not is_address(source) and find_archive(source, archive) is None:
                loose += files
                continue
            came = fetch_archive(_choices(meshes, files), source, archive, folder)
            brought += [file.path for file in came]
            unchecked += [file.path for file in came if not file.sha256]
    brought += fetch(loose, source, folder, label="meshes") if loose else []
    return Fetched(brought, unchecked)


def _choices(meshes: MeshSet, files: list[RemoteFile]) -> list[list[RemoteFile]]:
    """What an archive may hold: the files themselves, or some of them exchanged."""
    exchanged = []
    for file in files:
        head, _, tail = file.path.rpartition("/")
        other = dict(meshes.instead).get(tail)
        exchanged.append(
            file if other is None else RemoteFile(f"{head}/{other.path}", other.bytes, other.sha256)
        )
    return [files, exchanged] if exchanged != files else [files]
