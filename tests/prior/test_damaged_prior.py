"""Bits that flip and files that are cut: found by `brrp verify`, used by nobody."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from brrp_cli.cli import main
from brrp_cli.errors import PriorError
from brrp_cli.prior import store
from brrp_cli.prior.manifest import FILE
from brrp_cli.prior.store import open_prior, verify_prior

# The suite takes a part of them, `pytest -m long` all.
SHARE = pytest.mark.parametrize("every", [20, pytest.param(1, marks=pytest.mark.long)])
FLIPS = 1000


def contents(folder: Path) -> dict[str, str]:
    """A sum of everything that a reconstruction can read of a prior, by object. Errors:
    PriorError."""
    prior = open_prior(folder)
    found = {"parameters": json.dumps(prior.parameters, sort_keys=True)}
    looks = prior.appearance
    rows = looks.rows(np.arange(len(prior.names)))
    for name, row in zip(prior.names, rows, strict=True):
        item = prior.load(name)
        digest = hashlib.sha256(row.tobytes())
        digest.update(repr((item.name, item.description, item.half_extent)).encode())
        parts = [item.center, item.samples, item.labels, item.surface, item.surface_normals]
        for cloud in item.clouds.values():
            parts += [cloud.points, cloud.normals, cloud.fpfh]
        for pose in item.poses:
            parts += [pose.T_plane_object, np.array(pose.probability)]
        shape = item.shape
        parts += [shape.vertices, shape.faces, shape.colours]
        parts += [shape.field.lower, np.array(shape.field.spacing), shape.field.values]
        for part in parts:
            digest.update(np.ascontiguousarray(part).tobytes())
        found[name] = digest.hexdigest()
    for field in vars(looks.first).values():
        found["first"] = hashlib.sha256(
            field.tobytes() + str(found.get("first")).encode()
        ).hexdigest()
    return found


def files(folder: Path) -> list[Path]:
    """All files that a reader of a prior opens."""
    return sorted(p for p in folder.rglob("*") if p.is_file() and p.name != ".lock")


def harmed(whole: bytes, every: int, rng: np.random.Generator, count: int) -> Iterator[bytes]:
    for bit in rng.integers(8 * len(whole), size=count)[::every]:
        data = bytearray(whole)
        data[bit // 8] ^= 1 << (bit % 8)
        yield bytes(data)


def read_or_refused(folder: Path, right: dict[str, str]) -> bool:
    """Whether the prior can be read, and then to what it always was."""
    try:
        found = contents(folder)
    except PriorError as error:
        assert str(folder) in str(error) or str(error.where)
        return False
    assert found == right
    return True


@SHARE
def test_flipped_bits_are_found_and_never_used(prior_folder: Path, every: int) -> None:
    """1,000 bits over all files, each as many as it is long."""
    right = contents(prior_folder)
    rng = np.random.default_rng(0)
    total = sum(path.stat().st_size for path in files(prior_folder))
    tried = refused = 0
    for path in files(prior_folder):
        whole = path.read_bytes()
        count = max(every, round(FLIPS * len(whole) / total) + 1)
        for data in harmed(whole, every, rng, count):
            path.write_bytes(data)
            tried += 1
            if path.suffix == ".h5":
                assert len(verify_prior(open_prior(prior_folder))) == 1
            elif path.suffix == ".npy":
                assert "appearance" in verify_prior(open_prior(prior_folder))[0]
                path.write_bytes(data)
            refused += not read_or_refused(prior_folder, right)
            restore(path, whole)
    assert tried >= FLIPS / every and refused > tried / 2


@SHARE
def test_a_flipped_bit_in_the_manifest_is_refused(prior_folder: Path, every: int) -> None:
    right = contents(prior_folder)
    whole = (prior_folder / FILE).read_bytes()
    tried = 0
    for data in harmed(whole, every, np.random.default_rng(1), FLIPS):
        (prior_folder / FILE).write_bytes(data)
        tried += 1
        assert not read_or_refused(prior_folder, right)
        (prior_folder / FILE).write_bytes(whole)
    assert tried == FLIPS / every


@SHARE
def test_files_cut_at_every_64th_are_found_and_never_used(prior_folder: Path, every: int) -> None:
    right = contents(prior_folder)
    for path in files(prior_folder):
        whole = path.read_bytes()
        for part in range(0, 64, every):
            cut = whole[: len(whole) * part // 64]
            path.write_bytes(cut)
            if path.suffix == ".h5":
                assert len(verify_prior(open_prior(prior_folder))) == 1
                assert not read_or_refused(prior_folder, right)
            elif path.name == FILE:
                with pytest.raises(PriorError):
                    open_prior(prior_folder)
            else:
                # The rest is made again from shards and manifest.
                assert read_or_refused(prior_folder, right)
            restore(path, whole)


def restore(path: Path, whole: bytes) -> None:
    if whole:
        path.write_bytes(whole)
    else:
        path.unlink(missing_ok=True)


def test_a_shard_is_summed_once_for_each_run_before_its_data_are_used(
    pristine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    summed = []

    def counting(path: Path) -> str:
        summed.append(path)
        return real(path)

    real = store.sha256_file
    monkeypatch.setattr(store, "sha256_file", counting)
    prior = open_prior(pristine)
    assert summed == []
    for _ in range(3):
        for name in prior.names:
            prior.load(name)
    assert sorted(summed) == sorted((pristine / "shards").iterdir())


def test_a_bit_that_flips_after_the_sum_is_found_by_the_chunk(
    prior_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The sum is taken once; each chunk, and each object, has one of its own besides."""
    # Or an object that is held would not be read again.
    monkeypatch.setattr(store, "HELD", 0)
    prior = open_prior(prior_folder)
    for name in prior.names:
        prior.load(name)
    shard = max((prior_folder / "shards").iterdir(), key=lambda path: path.stat().st_size)
    whole = shard.read_bytes()
    names = [e.name for e in prior.manifest.objects if shard.name in e.shard]
    right = [prior.load(name).samples for name in names]
    assert names
    found = 0
    for data in harmed(whole, 1, np.random.default_rng(2), 60):
        shard.write_bytes(data)
        try:
            for name, samples in zip(names, right, strict=True):
                np.testing.assert_array_equal(prior.load(name).samples, samples)
        except PriorError:
            found += 1
        shard.write_bytes(whole)
    # What is left lies between data sets, where nobody reads.
    assert found > 40


def test_verify_names_the_damaged_shard_once(prior_folder: Path) -> None:
    shard = max((prior_folder / "shards").iterdir(), key=lambda path: path.stat().st_size)
    data = bytearray(shard.read_bytes())
    data[len(data) // 2] ^= 1
    shard.write_bytes(data)
    result = CliRunner().invoke(main, ["verify", str(prior_folder)])
    assert result.exit_code == 1 and shard.name in result.stdout
    assert result.stdout.count(shard.name) == 1
