import json
from pathlib import Path

import numpy as np
import pytest

from brrp_cli.errors import PriorError
from brrp_cli.prior.manifest import with_own_sum
from brrp_cli.prior.store import open_prior, verify_prior


def test_objects_are_normalised_and_described(prior_folder: Path) -> None:
    prior = open_prior(prior_folder)
    assert prior.names == ["ball", "ell", "red_box"]
    assert prior.descriptions["red_box"] == "a red box"
    box = prior.load("red_box")
    np.testing.assert_allclose(box.center, 0, atol=1e-9)
    assert box.half_extent == pytest.approx(0.05)
    np.testing.assert_allclose(np.abs(box.surface).max(axis=0), (1.0, 0.6, 0.4), atol=1e-6)
    inside = (np.abs(box.samples) < (1.0, 0.6, 0.4)).all(axis=1)
    assert (inside == box.labels).mean() > 0.995
    assert box.labels.dtype == bool
    assert [round(pose.probability, 6) for pose in box.poses] == sorted(
        [round(pose.probability, 6) for pose in box.poses], reverse=True
    )
    assert list(box.clouds) == [0.5, 1.0]
    np.testing.assert_allclose(np.abs(box.clouds[0.5].points).max(), 0.06, atol=0.006)
    outward = np.einsum("ij,ij->i", box.clouds[1.0].points, box.clouds[1.0].normals)
    assert (outward > 0).mean() > 0.95


def test_the_ell_knows_its_axes(prior_folder: Path) -> None:
    ell = open_prior(prior_folder).load("ell")
    # The box (10 x 6 x 4 cm at 0) and the arm (4 x 12 x 4 cm at (4, 5, 0)), in the mesh's metres.
    points = ell.samples * ell.half_extent + ell.center
    in_box = (np.abs(points) < (0.05, 0.03, 0.02)).all(axis=1)
    in_arm = (np.abs(points - (0.04, 0.05, 0)) < (0.02, 0.06, 0.02)).all(axis=1)
    assert ((in_box | in_arm) == ell.labels).mean() > 0.995
    assert "united 2" in "; ".join(ell.record["repair"]["steps"])


def test_an_unharmed_prior_has_no_problems(prior_folder: Path) -> None:
    assert verify_prior(open_prior(prior_folder)) == []


def one_shard(folder: Path) -> Path:
    return max((folder / "shards").iterdir(), key=lambda path: path.stat().st_size)


def loading_all(folder: Path) -> None:
    prior = open_prior(folder)
    for name in prior.names:
        prior.load(name)


def test_every_cut_is_found_and_never_read(prior_folder: Path) -> None:
    shard = one_shard(prior_folder)
    whole = shard.read_bytes()
    for k in range(0, 64, 7):
        shard.write_bytes(whole[: len(whole) * k // 64])
        assert len(verify_prior(open_prior(prior_folder))) == 1
        with pytest.raises(PriorError, match="damaged"):
            loading_all(prior_folder)


def test_every_flipped_bit_is_found_and_never_read(prior_folder: Path) -> None:
    shard = one_shard(prior_folder)
    whole = shard.read_bytes()
    rng = np.random.default_rng(0)
    for place in rng.integers(len(whole), size=40):
        data = bytearray(whole)
        data[place] ^= 1 << int(rng.integers(8))
        shard.write_bytes(data)
        assert len(verify_prior(open_prior(prior_folder))) == 1
        with pytest.raises(PriorError, match="damaged"):
            loading_all(prior_folder)


def test_missing_swapped_and_extra_shards_are_found(prior_folder: Path) -> None:
    shard = one_shard(prior_folder)
    whole = shard.read_bytes()
    shard.unlink()
    assert "missing" in verify_prior(open_prior(prior_folder))[0]
    with pytest.raises(PriorError, match="missing"):
        loading_all(prior_folder)
    shard.write_bytes(whole)
    (shard.parent / "shard-0123456789abcdef.h5").write_bytes(whole)
    assert "does not list" in verify_prior(open_prior(prior_folder))[0]


def rewrite(folder: Path, change: dict[str, object]) -> None:
    path = folder / "manifest.json"
    table = json.loads(path.read_text())
    # Whoever forges a manifest mends its sum.
    path.write_bytes(with_own_sum({**table, **change}))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"schema": 99}, "newer brrp"),
        ({"kind": "web app"}, "not that of a prior"),
        ({"objects": [{"name": "cup"}]}, "cannot be used"),
        ({"shards": [{"file": "../evil.h5", "sha256": "", "bytes": 1}]}, "evil"),
        ({"shards": [{"file": "/etc/passwd", "sha256": "", "bytes": 1}]}, "passwd"),
        ({"shards": []}, "not listed"),
    ],
)
def test_bad_manifests_are_refused(
    prior_folder: Path, change: dict[str, object], told: str
) -> None:
    rewrite(prior_folder, change)
    with pytest.raises(PriorError, match=told):
        open_prior(prior_folder)


def test_no_prior_and_no_json_are_told(tmp_path: Path) -> None:
    with pytest.raises(PriorError, match="No prior here"):
        open_prior(tmp_path)
    (tmp_path / "manifest.json").write_text('{"kind": ')
    with pytest.raises(PriorError, match="cannot be used"):
        open_prior(tmp_path)


@pytest.mark.parametrize("path", [None, 3])
def test_what_is_no_path_is_told(path: object) -> None:
    with pytest.raises(PriorError, match=r"no path of a prior(.|\n)*build-prior"):
        open_prior(path)  # type: ignore[arg-type]
