"""Priors that were made to do harm: one message, soon, in little memory, and no other file read.

Whoever forges a shard can forge the manifest that vouches for it, so all are vouched for.
"""

from __future__ import annotations

import json
import resource
import signal
import time
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from file_faults import in_a_process

from brrp_cli.errors import PriorError
from brrp_cli.files import sha256_file
from brrp_cli.prior.index import INDEX_FILE
from brrp_cli.prior.manifest import FILE, read_manifest, with_own_sum, write_manifest
from brrp_cli.prior.shard import ARRAYS
from brrp_cli.prior.store import open_prior, verify_prior

NAME = "red_box"
MEGABYTES, SECONDS = 200, 5
SHARD, LOOKS = "shards/shard-0123456789abcdef.h5", "appearance-0123456789abcdef.npy"


def forge(folder: Path, change: Callable[[h5py.File], None]) -> None:
    """Change the shard of `NAME`, and the manifest so that it vouches for it."""
    manifest = read_manifest(folder)
    (file,) = [entry.shard for entry in manifest.objects if entry.name == NAME]
    with h5py.File(folder / file, "r+") as shard:
        change(shard)
    shards = [
        replace(s, sha256=sha256_file(folder / file), bytes=(folder / file).stat().st_size)
        if s.file == file
        else s
        for s in manifest.shards
    ]
    write_manifest(folder, replace(manifest, shards=shards))
    (folder / INDEX_FILE).unlink()


def refused(folder: Path) -> str:
    """The one message, given within the bounds of memory and of time."""
    answer = folder.with_name("answer")

    def work() -> None:
        with Path("/proc/self/statm").open() as stream:
            used = int(stream.read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + MEGABYTES * 2**20, resource.RLIM_INFINITY))
        signal.alarm(60)
        start = time.process_time()
        try:
            prior = open_prior(folder)
            prior.load(NAME)
            told = "no error"
        except PriorError as error:
            told = str(error)
            assert len(verify_prior(prior)) >= 1
        assert time.process_time() - start < SECONDS
        answer.write_text(told)

    assert in_a_process(work) == 0
    return answer.read_text()


def put(
    file: h5py.File, key: str, data: np.ndarray | None = None, **options: object
) -> h5py.Dataset:
    group = file[f"objects/{NAME}"]
    del group[key]
    return group.create_dataset(key, data=data, **{"fletcher32": True, "chunks": True, **options})


def dataset_elsewhere(kind: str) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        group = file[f"objects/{NAME}"]
        other = Path(file.filename).parents[2] / "secret.h5"
        with h5py.File(other, "w") as secret:
            secret["samples"] = group["samples"][...]
            file.copy(f"objects/{NAME}", secret, "red_box")
        if kind == "whole":
            del file["objects"]
            file["objects"] = h5py.ExternalLink(str(other), "/")
            return
        if kind == "object":
            del file[f"objects/{NAME}"]
            file[f"objects/{NAME}"] = h5py.ExternalLink(str(other), "/red_box")
            return
        del group["samples"]
        if kind == "link":
            group["samples"] = h5py.ExternalLink(str(other), "/samples")
        elif kind == "soft":
            group["samples"] = h5py.SoftLink(f"/objects/{NAME}/surface")
        elif kind == "virtual":
            layout = h5py.VirtualLayout((400, 3), "f4")
            layout[:] = h5py.VirtualSource(str(other), "samples", (400, 3))
            group.create_virtual_dataset("samples", layout)
        else:
            raw = Path(file.filename).parents[2] / "raw"
            raw.write_bytes(bytes(4800))
            group.create_dataset("samples", (400, 3), "f4", external=[(str(raw), 0, 4800)])

    return change


@pytest.mark.parametrize("kind", ["link", "soft", "virtual", "external", "object", "whole"])
def test_no_other_file_is_read(prior_folder: Path, kind: str) -> None:
    forge(prior_folder, dataset_elsewhere(kind))
    told = refused(prior_folder)
    assert "A shard is damaged" in told, told


def bomb(file: h5py.File, size: int = 250_000_000) -> None:
    """250 kB that unpack to 250 MB, in one chunk of a plain shape."""
    options = {"chunks": (400, 3), "compression": "gzip", "shuffle": True}
    data = put(file, "samples", shape=(400, 3), dtype="<f4", **options)
    # HDF5 looks at the checksum only once all is unpacked.
    data.id.write_direct_chunk((0, 0), zlib.compress(bytes(size)) + bytes(4))


def group_for_array(file: h5py.File) -> None:
    group = file[f"objects/{NAME}"]
    del group["box"]
    group.create_group("box")


HOSTILE: dict[str, tuple[Callable[[h5py.File], None], str]] = {
    "10^12 rows": (
        lambda f: put(f, "samples", shape=(10**12, 3), dtype="<f4", chunks=(1000, 3)),
        "1000000000000",
    ),
    "2^62 rows": (
        lambda f: put(f, "samples", shape=(2**62, 3), dtype="<f4", chunks=(1000, 3)),
        "A shard is damaged",
    ),
    "all arrays together": (
        lambda f: [
            put(f, key, shape=(6_000_000, 3), dtype="<f4", chunks=(30_000, 3))
            for key in ("surface", "surface_normals", "samples", "cloud_points")
        ],
        "A shard is damaged",
    ),
    "a bomb": (bomb, "a chunk of 2"),
    "a small bomb": (lambda f: bomb(f, 8_000_000), "does not unpack"),
    "chunks of one row": (
        lambda f: put(f, "samples", shape=(5_000_000, 3), dtype="<f4", chunks=(1, 3)),
        "chunks of",
    ),
    "a chunk of a gigabyte": (
        lambda f: put(
            f,
            "samples",
            shape=(400, 3),
            dtype="<f4",
            chunks=(90_000_000, 3),
            maxshape=(None, 3),
        ),
        "chunks of",
    ),
    "another filter": (
        lambda f: put(f, "samples", np.zeros((400, 3), "<f4"), compression="lzf"),
        "filters",
    ),
    "a chunk without its checksum": (
        lambda f: put(
            f, "samples", shape=(400, 3), dtype="<f4", chunks=(400, 3)
        ).id.write_direct_chunk((0, 0), bytes(4800), filter_mask=1),
        "without its checksum",
    ),
    "no JSON": (
        lambda f: f[f"objects/{NAME}"].attrs.__setitem__("record", "{"),
        "A shard is damaged",
    ),
    "endless JSON": (
        lambda f: f[f"objects/{NAME}"].attrs.__setitem__("record", 60_000 * "["),
        "A shard is damaged",
    ),
    "a number for a record": (
        lambda f: f[f"objects/{NAME}"].attrs.__setitem__("record", 7),
        "A shard is damaged",
    ),
    "no sum": (
        lambda f: f[f"objects/{NAME}"].attrs.__delitem__("content_sha256"),
        "A shard is damaged",
    ),
    "a group for an array": (
        lambda f: (
            f[f"objects/{NAME}"].__delitem__("box"),
            f[f"objects/{NAME}"].create_group("box"),
        ),
        "A shard is damaged",
    ),
    "an array for a group": (
        lambda f: (f.__delitem__("objects"), f.__setitem__("objects", np.zeros(3))),
        "A shard is damaged",
    ),
    "a newer schema": (lambda f: f.attrs.__setitem__("schema", 99), "another version of brrp"),
    "a schema of text": (lambda f: f.attrs.__setitem__("schema", "two"), "A shard is damaged"),
    "another kind": (lambda f: f.attrs.__setitem__("kind", "photos"), "no shard"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_forged_shard_is_one_message_in_bounded_time_and_memory(
    prior_folder: Path, name: str
) -> None:
    change, told = HOSTILE[name]
    forge(prior_folder, change)  # type: ignore[arg-type]
    message = refused(prior_folder)
    assert told in message, message
    assert message.count("\n") < 6


@pytest.mark.parametrize("key", [k for k, (dtype, _) in ARRAYS.items() if "f" in dtype])
def test_numbers_that_are_no_numbers_never_leave_a_shard(prior_folder: Path, key: str) -> None:
    def change(file: h5py.File) -> None:
        data = file[f"objects/{NAME}/{key}"][...]
        data.flat[data.size // 2] = np.nan if data.size % 2 else np.inf
        put(file, key, data)

    forge(prior_folder, change)
    with pytest.raises(PriorError, match=f"{key}: values that are NaN or infinite"):
        open_prior(prior_folder).load(NAME)


def test_a_sparse_file_of_a_terabyte_is_not_summed(prior_folder: Path) -> None:
    manifest = read_manifest(prior_folder)
    first = manifest.shards[0]
    with (prior_folder / first.file).open("r+b") as stream:
        stream.truncate(10**12)
    with pytest.raises(PriorError, match="in place of"):
        for name in manifest.objects:
            open_prior(prior_folder).load(name.name)
    write_manifest(
        prior_folder,
        replace(manifest, shards=[replace(first, bytes=10**12), *manifest.shards[1:]]),
    )
    with pytest.raises(PriorError, match="1000000000000 bytes"):
        open_prior(prior_folder)


MANIFESTS: dict[str, Callable[[dict], object]] = {
    "a path upwards": lambda t: t["shards"][0].update(file="shards/../../x.h5"),
    "an absolute path": lambda t: t["shards"][0].update(file=f"/{SHARD}"),
    "a path with a newline": lambda t: t["shards"][0].update(
        file="shards/shard-0123456789abcdef.h5\n"
    ),
    "descriptors elsewhere": lambda t: t["appearance"].update(
        file="../appearance-0123456789abcdef.npy"
    ),
    "a name upwards": lambda t: t["objects"][0].update(name="../../home"),
    "a name with a slash": lambda t: t["objects"][0].update(name="a/b"),
    "a name of no text": lambda t: t["objects"][0].update(name=7),
    "a name twice": lambda t: t["objects"].append(dict(t["objects"][0])),
    "a phrase of no text": lambda t: t["objects"][0].update(description=None),
    "a record of no table": lambda t: t["objects"][0].update(record=[]),
    "versions of no table": lambda t: t["objects"][0]["record"].update(made_with=[1]),
    "bytes of text": lambda t: t["shards"][0].update(bytes="many"),
    "negative bytes": lambda t: t["shards"][0].update(bytes=-1),
    "infinite bytes": lambda t: t["shards"][0].update(bytes=float("inf")),
    "bytes without end": lambda t: t["shards"][0].update(bytes=10**400),
    "a sum of no sum": lambda t: t["shards"][0].update(sha256="0"),
    "one more key": lambda t: t["shards"][0].update(hint="rm -rf"),
    "objects of no list": lambda t: t.update(objects=7),
    "a list for a table": lambda t: t.update(parameters=[1, 2]),
    "a failure of no text": lambda t: t.update(failed=[{"name": 1, "source": 2, "reason": 3}]),
    "a schema of text": lambda t: t.update(schema="x"),
    "an endless schema": lambda t: t.update(schema=float("inf")),
    "a newer schema": lambda t: t.update(schema=99),
    "no appearance": lambda t: t.pop("appearance"),
    "views without end": lambda t: t["parameters"]["appearance"].update(views=10**12),
    "no views": lambda t: t["parameters"].update(appearance=None),
    "other views than stored": lambda t: t["parameters"]["appearance"].update(views=7),
}


@pytest.mark.parametrize("name", MANIFESTS)
def test_a_forged_manifest_is_one_message(prior_folder: Path, name: str) -> None:
    table = json.loads((prior_folder / FILE).read_text())
    MANIFESTS[name](table)
    (prior_folder / FILE).write_bytes(with_own_sum(table))
    (prior_folder / INDEX_FILE).unlink()
    with pytest.raises(PriorError) as caught:
        prior = open_prior(prior_folder)
        assert "views" in name
        prior.appearance.rows(np.arange(len(prior.names)))
    assert len(str(caught.value)) < 2_000


def test_a_manifest_without_its_own_sum_is_refused(prior_folder: Path) -> None:
    table = json.loads((prior_folder / FILE).read_text())
    del table["content_sha256"]
    (prior_folder / FILE).write_text(json.dumps(table, indent=1))
    with pytest.raises(PriorError, match="no content_sha256"):
        open_prior(prior_folder)


def test_manifests_that_are_no_json_or_endless_are_one_message(prior_folder: Path) -> None:
    for data in (b"", b"\xff\xfe", b"[" * 10**6, b'{"a":' * 10**5, b"null", b"[]", b"7" * 10**5):
        (prior_folder / FILE).write_bytes(data)
        with pytest.raises(PriorError):
            open_prior(prior_folder)
    (prior_folder / FILE).unlink()
    with (prior_folder / FILE).open("wb") as stream:
        stream.truncate(10**12)
    with pytest.raises(PriorError, match="at most"):
        open_prior(prior_folder)
