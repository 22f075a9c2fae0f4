"""Objects added and removed, priors merged: the bytes of a build of all meshes together."""

from __future__ import annotations

import shutil
from pathlib import Path

import filelock
import h5py
import pytest
import trimesh
from small_prior import SMALL, prior_bytes

from brrp_cli.errors import MeshError, PriorError
from brrp_cli.prior.build import build, edit
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.build.edit import add_objects, merge_priors, remove_objects
from brrp_cli.prior.build.shard_plan import plan_shards
from brrp_cli.prior.parameters import BuildParameters, restore_parameters
from brrp_cli.prior.store import open_prior, verify_prior

# Names are cut after "ad" and after "ah": each folder changes both shards of the other.
FIRST, SECOND = ["ad", "ah"], ["aa", "ae"]


def write_boxes(folder: Path, names: list[str]) -> Path:
    folder.mkdir()
    for name in names:
        size = 0.05 + 0.01 * (ord(name[1]) - ord("a"))
        trimesh.creation.box((size, 0.04, 0.03)).export(folder / f"{name}.ply")
    return folder


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Two folders of meshes, a prior of each and a prior of both."""
    root = tmp_path_factory.mktemp("edit")
    first, second = write_boxes(root / "a", FIRST), write_boxes(root / "b", SECOND)
    (second / "bad.obj").write_text("")
    build_prior(first, root / "prior_a", SMALL, workers=1)
    build_prior(second, root / "prior_b", SMALL, workers=1)
    build_prior([first, second], root / "both", SMALL, workers=1)
    return {name: root / name for name in ("a", "b", "prior_a", "prior_b", "both")}


@pytest.fixture
def prior(places: dict[str, Path], tmp_path: Path) -> Path:
    """The prior of the first folder, to change."""
    return Path(shutil.copytree(places["prior_a"], tmp_path / "prior"))


def no_work(*_: object) -> None:
    raise AssertionError("nothing was to be made")


def test_several_folders_make_one_prior(places: dict[str, Path], tmp_path: Path) -> None:
    union = Path(shutil.copytree(places["a"], tmp_path / "union"))
    for path in places["b"].iterdir():
        shutil.copy(path, union)
    copy = Path(shutil.copytree(places["both"], tmp_path / "copy"))
    assert build_prior(union, copy, SMALL, workers=1).made == []
    assert prior_bytes(copy) == prior_bytes(places["both"])
    assert open_prior(copy).names == sorted(FIRST + SECOND)


def test_one_name_in_two_folders_is_told(places: dict[str, Path], tmp_path: Path) -> None:
    with pytest.raises(MeshError, match="objects of one name") as caught:
        build_prior([places["a"], places["a"]], tmp_path / "prior", SMALL)
    assert str(places["a"] / "ad.ply") in str(caught.value.found)


def test_added_objects_alone_are_made(places: dict[str, Path], prior: Path) -> None:
    report = add_objects(prior, [places["b"]], workers=1)
    assert report.made == SECOND
    assert report.kept == FIRST
    assert [failure.name for failure in report.manifest.failed] == ["bad"]
    assert prior_bytes(prior) == prior_bytes(places["both"])
    assert verify_prior(open_prior(prior)) == []


@pytest.mark.slow
def test_files_are_added_one_by_one(places: dict[str, Path], prior: Path) -> None:
    add_objects(prior, [places["b"] / "ae.ply", places["b"] / "bad.obj"], workers=1)
    add_objects(prior, [places["b"] / "aa.ply"], workers=1)
    assert prior_bytes(prior) == prior_bytes(places["both"])


def test_an_added_shard_is_read_only_where_it_changes(
    places: dict[str, Path], prior: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a large prior lives of: adding must not read all of it."""
    assert len(plan_shards(sorted([*FIRST, "ae"]))) == 2
    read: list[str] = []
    real = build.read_stored
    monkeypatch.setattr(
        build, "read_stored", lambda shard, name: read.append(name) or real(shard, name)
    )
    add_objects(prior, [places["b"] / "ae.ply"], workers=1)
    assert read == ["ah"]


def test_an_object_that_is_there_is_kept_or_replaced(
    places: dict[str, Path], prior: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = prior_bytes(prior)
    assert add_objects(prior, [places["a"]], workers=1).made == []
    assert prior_bytes(prior) == before
    other = tmp_path / "other"
    other.mkdir()
    trimesh.creation.box((0.2, 0.1, 0.1)).export(other / "ad.ply")
    with pytest.raises(PriorError, match="--replace"):
        add_objects(prior, [other])
    assert prior_bytes(prior) == before
    assert add_objects(prior, [other], replace=True, workers=1).made == ["ad"]
    assert open_prior(prior).load("ad").half_extent == pytest.approx(0.1)
    shutil.copy(places["a"] / "ah.ply", other)
    build_prior(other, tmp_path / "afresh", SMALL, workers=1)
    assert prior_bytes(prior) == prior_bytes(tmp_path / "afresh")
    (other / "AD.ply").write_bytes((other / "ad.ply").read_bytes())
    with pytest.raises(MeshError, match="case"):
        add_objects(prior, [other / "AD.ply"])


def test_removed_objects_leave_the_prior_of_the_others(
    places: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prior = Path(shutil.copytree(places["both"], tmp_path / "prior"))
    monkeypatch.setattr(build, "make_stored", no_work)
    assert remove_objects(prior, ["ae", "aa", "bad"]).removed == SECOND
    assert prior_bytes(prior) == prior_bytes(places["prior_a"])
    before = prior_bytes(prior)
    with pytest.raises(PriorError, match="no such object"):
        remove_objects(prior, ["ax"])
    with pytest.raises(PriorError, match="without objects"):
        remove_objects(prior, FIRST)
    assert prior_bytes(prior) == before


def test_merged_priors_are_the_prior_of_all_meshes(
    places: dict[str, Path], prior: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(build, "make_stored", no_work)
    out = tmp_path / "merged"
    merge_priors([places["prior_b"], places["prior_a"]], out)
    assert prior_bytes(out) == prior_bytes(places["both"])
    assert verify_prior(open_prior(out)) == []
    with pytest.raises(PriorError, match="Another prior is there"):
        merge_priors([places["prior_a"], places["prior_b"]], out)
    # Into one of them; and with itself, which changes nothing.
    merge_priors([prior, places["prior_b"], prior], prior)
    assert prior_bytes(prior) == prior_bytes(places["both"])


def test_priors_that_do_not_fit_are_refused(
    places: dict[str, Path], prior: Path, tmp_path: Path
) -> None:
    other = tmp_path / "other"
    build_prior(places["a"], other, BuildParameters(**{**vars(SMALL), "seed": 7}), workers=1)
    with pytest.raises(PriorError, match="seed: 0 -> 7"):
        merge_priors([prior, other], tmp_path / "out")
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    trimesh.creation.box((0.2, 0.1, 0.1)).export(meshes / "ad.ply")
    build_prior(meshes, tmp_path / "third", SMALL, workers=1)
    with pytest.raises(PriorError, match="different objects of one name"):
        merge_priors([prior, tmp_path / "third"], tmp_path / "out")
    assert not (tmp_path / "out" / "manifest.json").exists()


def test_a_damaged_shard_is_never_taken_over(
    places: dict[str, Path], prior: Path, tmp_path: Path
) -> None:
    for shard in (prior / "shards").iterdir():
        with h5py.File(shard) as file:
            (name,) = file["objects"]
            chunk = file[f"objects/{name}/samples"].id.get_chunk_info(0)
        data = bytearray(shard.read_bytes())
        data[chunk.byte_offset + chunk.size // 2] ^= 1
        shard.write_bytes(data)
    before = prior_bytes(prior)
    with pytest.raises(PriorError, match="damaged"):
        merge_priors([prior, places["prior_b"]], tmp_path / "out")
    shard.write_bytes(data[:-1])
    with pytest.raises(PriorError, match="in place of"):
        remove_objects(prior, ["ad"])
    assert (prior / "manifest.json").read_bytes() == before["manifest.json"]


def test_a_killed_add_goes_on_with_what_was_made(
    places: dict[str, Path], prior: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(*_: object) -> None:
        raise SystemExit

    with monkeypatch.context() as patch, pytest.raises(SystemExit):
        patch.setattr(build, "write_manifest", killed)
        add_objects(prior, [places["b"]], workers=1)
    assert open_prior(prior).names == FIRST
    assert add_objects(prior, [places["b"]], workers=1).made == []
    assert prior_bytes(prior) == prior_bytes(places["both"])


def test_one_at_a_time_and_only_where_there_is_a_prior(
    places: dict[str, Path], prior: Path, tmp_path: Path
) -> None:
    with filelock.FileLock(prior / ".lock"):
        for change in (
            lambda: add_objects(prior, [places["b"]]),
            lambda: remove_objects(prior, ["ad"]),
            lambda: merge_priors([prior, places["prior_b"]], prior),
        ):
            with pytest.raises(PriorError, match="Another build is at work"):
                change()
    with pytest.raises(PriorError, match="No prior here"):
        edit.add_objects(tmp_path / "none", [places["b"]])
    assert not (tmp_path / "none").exists()


def test_parameters_come_back_from_their_table() -> None:
    assert restore_parameters(SMALL.as_dict(), "here") == SMALL
    with pytest.raises(PriorError, match="other parameters"):
        restore_parameters({**SMALL.as_dict(), "blur": 3}, "here")
    with pytest.raises(PriorError, match="other parameters"):
        restore_parameters({"seed": 0}, "here")
