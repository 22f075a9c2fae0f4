import dataclasses
from pathlib import Path

import h5py
import numpy as np
import pytest
from stored_example import example

from brrp_cli.errors import PriorError
from brrp_cli.prior.pack import pack, unpack
from brrp_cli.prior.shard import ARRAYS, object_names, open_shard, read_stored, write_shard


@pytest.fixture
def shard(tmp_path: Path) -> Path:
    path = tmp_path / "shard.h5"
    objects = [pack(example("cup"), "aa"), pack(example("jar", 1), "bb")]
    write_shard(path, objects, {"seed": 0})
    return path


def test_what_is_written_is_read(shard: Path) -> None:
    with open_shard(shard) as file:
        assert object_names(file) == ["cup", "jar"]
        stored = read_stored(file, "jar")
    assert stored.input_sha256 == "bb"
    want, got = example("jar", 1), unpack(stored, "a cup")
    for key in ("name", "description", "half_extent", "record"):
        assert getattr(got, key) == getattr(want, key)
    for key in ("center", "samples", "labels", "surface", "surface_normals"):
        np.testing.assert_array_equal(getattr(got, key), getattr(want, key))
        assert getattr(got, key).dtype == getattr(want, key).dtype
    assert list(got.clouds) == [0.5, 1.22]
    for scale, cloud in got.clouds.items():
        np.testing.assert_allclose(cloud.points, want.clouds[scale].points, rtol=1e-6)
        np.testing.assert_allclose(cloud.normals, want.clouds[scale].normals, atol=1e-3)
        np.testing.assert_allclose(cloud.fpfh, want.clouds[scale].fpfh, rtol=1e-3)
        assert cloud.fpfh.dtype == np.float64
    assert [pose.probability for pose in got.poses] == [0.75, 0.25]
    for key in ("vertices", "faces", "colours"):
        np.testing.assert_array_equal(getattr(got.shape, key), getattr(want.shape, key))
        assert getattr(got.shape, key).dtype == getattr(want.shape, key).dtype
    np.testing.assert_array_equal(got.shape.field.values, want.shape.field.values)
    np.testing.assert_array_equal(got.shape.field.lower, want.shape.field.lower)
    assert got.shape.field.spacing == want.shape.field.spacing


@pytest.mark.parametrize("corner", [-1, 30, 2**31 - 1])
def test_a_face_with_a_corner_that_is_not_there_is_refused(tmp_path: Path, corner: int) -> None:
    """Though every checksum is right: it was written so."""
    item = example()
    faces = item.shape.faces.copy()
    faces[7, 1] = corner
    item = dataclasses.replace(item, shape=dataclasses.replace(item.shape, faces=faces))
    write_shard(tmp_path / "bad.h5", [pack(item, "aa")], {})
    assert "faces have corners that it lacks" in reading(tmp_path / "bad.h5")


def test_a_mesh_without_faces_is_refused(tmp_path: Path) -> None:
    item = example()
    none = dataclasses.replace(item.shape, faces=np.zeros((0, 3), np.int32))
    write_shard(tmp_path / "bad.h5", [pack(dataclasses.replace(item, shape=none), "aa")], {})
    with pytest.raises(PriorError), open_shard(tmp_path / "bad.h5") as file:
        read_stored(file, "cup")


def test_taking_an_object_over_gives_the_same_bytes(shard: Path, tmp_path: Path) -> None:
    with open_shard(shard) as file:
        objects = [read_stored(file, name) for name in object_names(file)]
    write_shard(tmp_path / "again.h5", objects, {"seed": 0})
    assert (tmp_path / "again.h5").read_bytes() == shard.read_bytes()


def test_every_data_set_has_checksums(shard: Path) -> None:
    with h5py.File(shard) as file:
        for key in ARRAYS:
            assert file["objects/cup"][key].fletcher32


def replace(shard: Path, key: str, data: np.ndarray, **options: object) -> None:
    with h5py.File(shard, "r+") as file:
        group = file["objects/cup"]
        del group[key]
        group.create_dataset(key, data=data, **{"chunks": True, "fletcher32": True, **options})


def reading(shard: Path) -> str:
    with pytest.raises(PriorError) as caught, open_shard(shard) as file:
        read_stored(file, "cup")
    return str(caught.value)


def test_wrong_arrays_are_named(shard: Path) -> None:
    pristine = shard.read_bytes()
    samples = example().samples
    cases = {
        "<f4": samples.astype(np.float64),
        "expected 50": np.zeros(49, np.uint8),
        "NaN": np.full((50, 3), np.nan, np.float32),
        "checksum": samples + 1,
        "samples: <f4 (50,)": samples[:, 0],
    }
    for told, data in cases.items():
        shard.write_bytes(pristine)
        replace(shard, "labels" if told == "expected 50" else "samples", data)
        assert told in reading(shard)
    shard.write_bytes(pristine)
    replace(shard, "samples", samples, fletcher32=False)
    assert "with checksums" in reading(shard)


def test_a_huge_declared_shape_is_refused_unread(shard: Path) -> None:
    with h5py.File(shard, "r+") as file:
        del file["objects/cup/samples"]
        options = {"chunks": (1000, 3), "fletcher32": True}
        file["objects/cup"].create_dataset("samples", (10**12, 3), "f4", **options)
    assert "1000000000000" in reading(shard)


def test_links_out_of_the_file_are_not_followed(shard: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.h5"
    other.write_bytes(shard.read_bytes())
    for link in (h5py.ExternalLink(str(other), "/objects/cup/samples"), h5py.SoftLink("/a")):
        with h5py.File(shard, "r+") as file:
            if "samples" in file["objects/cup"].keys():  # noqa: SIM118, a dangling link too
                del file["objects/cup/samples"]
            file["objects/cup/samples"] = link
        assert "no data set samples" in reading(shard)
    with h5py.File(shard, "r+") as file:
        del file["objects"]
        file["objects"] = h5py.ExternalLink(str(other), "/objects")
    with pytest.raises(PriorError, match="no group"), open_shard(shard) as file:
        object_names(file)


def test_what_is_no_shard_or_newer_is_told(shard: Path, tmp_path: Path) -> None:
    with h5py.File(shard, "r+") as file:
        file.attrs["schema"] = 99
    with pytest.raises(PriorError, match="another version of brrp"), open_shard(shard):
        pass
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["a"] = 1
    with pytest.raises(PriorError, match="no shard"), open_shard(tmp_path / "x.h5"):
        pass
    with pytest.raises(PriorError, match="missing"), open_shard(tmp_path / "absent.h5"):
        pass
