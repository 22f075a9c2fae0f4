import hashlib
import json
from dataclasses import replace
from pathlib import Path

import pytest
from small_prior import SMALL

from brrp_cli.errors import PriorError
from brrp_cli.files import sha256_file
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.index import INDEX_FILE
from brrp_cli.prior.manifest import FILE, Failure, read_manifest, write_manifest
from brrp_cli.prior.store import open_prior


def test_the_builder_leaves_what_the_manifest_says(pristine: Path) -> None:
    assert (pristine / INDEX_FILE).is_file()
    prior, manifest = open_prior(pristine), read_manifest(pristine)
    assert prior.names == [entry.name for entry in manifest.objects]
    assert prior.phrases == [entry.description for entry in manifest.objects]
    assert prior.index.shards == manifest.shards
    assert prior.index.appearance == manifest.appearance
    assert prior.parameters == manifest.parameters
    assert prior.digest == sha256_file(pristine / FILE)
    assert prior.manifest == manifest
    for entry in manifest.objects:
        shard = prior.index.shards[prior.index.shard_of[prior.index.rows[entry.name]]]
        assert shard.file == entry.shard


@pytest.mark.parametrize("harm", ["missing", "empty", "cut", "changed", "other", "newer", "folder"])
def test_what_is_no_index_of_this_manifest_is_made_again(prior_folder: Path, harm: str) -> None:
    path = prior_folder / INDEX_FILE
    whole = path.read_bytes()
    line = whole.split(b"\n")[1]
    path.unlink()
    if harm == "empty":
        path.write_bytes(b"")
    elif harm == "cut":
        path.write_bytes(whole[: len(whole) // 2])
    elif harm == "changed":
        path.write_bytes(whole.replace(b'"a red box"', b'"a bed rox"'))
    elif harm == "other":
        path.write_bytes(signed(json.loads(line) | {"digest": "0" * 64, "names": ["cup"]}))
    elif harm == "newer":
        path.write_bytes(signed(json.loads(line) | {"schema": 99, "colours": []}))
    elif harm == "folder":
        path.mkdir()
    prior = open_prior(prior_folder)
    assert prior.names == ["ball", "ell", "red_box"]
    assert prior.load("red_box").description == "a red box"
    if harm != "folder":
        assert path.read_bytes() == whole


def signed(table: dict[str, object]) -> bytes:
    line = json.dumps(table).encode()
    return hashlib.sha256(line).hexdigest().encode() + b"\n" + line + b"\n"


def test_an_index_leads_to_no_file_outside_of_the_prior(prior_folder: Path) -> None:
    path = prior_folder / INDEX_FILE
    table = json.loads(path.read_bytes().split(b"\n")[1])
    table["shards"] = [["../evil.h5", *shard[1:]] for shard in table["shards"]]
    path.write_bytes(signed(table))
    assert all(shard.file.startswith("shards/") for shard in open_prior(prior_folder).index.shards)


def test_a_manifest_that_was_damaged_later_is_noticed(prior_folder: Path) -> None:
    assert (prior_folder / INDEX_FILE).is_file()
    whole = (prior_folder / FILE).read_bytes()
    (prior_folder / FILE).write_bytes(whole[:-10])
    with pytest.raises(PriorError, match="cannot be used"):
        open_prior(prior_folder)


def test_another_manifest_than_that_which_was_opened_is_told(prior_folder: Path) -> None:
    prior = open_prior(prior_folder)
    write_manifest(prior_folder, replace(prior.manifest, failed=[Failure("a", "a.obj", "why")]))
    prior = replace(prior)
    with pytest.raises(PriorError, match="built again"):
        prior.manifest  # noqa: B018
    assert open_prior(prior_folder).manifest.objects


def test_where_no_index_can_be_written_the_prior_is_read(prior_folder: Path) -> None:
    (prior_folder / INDEX_FILE).unlink()
    # Not by taking rights away: root has them all.
    (prior_folder / INDEX_FILE).mkdir()
    assert open_prior(prior_folder).names == ["ball", "ell", "red_box"]


def test_a_build_that_changes_nothing_makes_a_lost_index_again(
    prior_folder: Path, meshes: Path
) -> None:
    whole = (prior_folder / INDEX_FILE).read_bytes()
    (prior_folder / INDEX_FILE).unlink()
    build_prior(meshes, prior_folder, SMALL, workers=1)
    assert (prior_folder / INDEX_FILE).read_bytes() == whole
