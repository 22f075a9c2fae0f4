import os
from pathlib import Path

import pytest

from brrp_cli.errors import OutputError
from brrp_cli.files import atomic_folder, atomic_path, sha256_file, write_bytes


class CrashError(Exception):
    pass


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_sha256_of_a_known_text(tmp_path: Path) -> None:
    (tmp_path / "abc").write_bytes(b"abc")
    assert sha256_file(tmp_path / "abc") == (
        "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    )


def test_a_file_appears_whole_in_a_new_folder(tmp_path: Path) -> None:
    target = tmp_path / "new" / "deep" / "a.npz"
    with atomic_path(target) as partial:
        partial.write_bytes(b"new")
        assert not target.exists()
        # The suffix stays, because many writers choose the format by it.
        assert partial.suffix == ".npz"
        assert partial.parent == target.parent
    assert target.read_bytes() == b"new"
    assert names(target.parent) == ["a.npz"]
    assert target.stat().st_mode & 0o777 == 0o644


def test_a_file_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"old")
    write_bytes(tmp_path / "a", b"new")
    assert (tmp_path / "a").read_bytes() == b"new"
    assert names(tmp_path) == ["a"]


def test_a_crash_leaves_the_old_file_and_no_rest(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"old")
    with pytest.raises(CrashError), atomic_path(tmp_path / "a") as partial:
        partial.write_bytes(b"half")
        raise CrashError
    assert (tmp_path / "a").read_bytes() == b"old"
    assert names(tmp_path) == ["a"]


def test_a_reader_keeps_the_old_bytes_while_a_file_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"old")
    with (tmp_path / "a").open("rb") as reader:
        write_bytes(tmp_path / "a", b"new")
        assert reader.read() == b"old"


def test_a_full_disk_while_writing_is_told_and_leaves_the_old_file(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"old")
    with pytest.raises(OutputError, match="No space left"), atomic_path(tmp_path / "a"):
        Path("/dev/full").write_bytes(b"x")
    assert (tmp_path / "a").read_bytes() == b"old"
    assert names(tmp_path) == ["a"]


def test_a_file_below_a_regular_file_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(OutputError, match="Cannot write") as caught:
        write_bytes(tmp_path / "file" / "a", b"new")
    assert caught.value.where == tmp_path / "file" / "a"


def test_a_folder_appears_whole(tmp_path: Path) -> None:
    target = tmp_path / "new" / "out"
    with atomic_folder(target, overwrite=False) as partial:
        (partial / "meshes").mkdir()
        (partial / "meshes" / "7.ply").write_bytes(b"ply")
        assert not target.exists()
    assert (target / "meshes" / "7.ply").read_bytes() == b"ply"
    assert names(target.parent) == ["out"]
    assert target.stat().st_mode & 0o777 == 0o755


def test_an_existing_folder_is_refused_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old").write_bytes(b"old")
    with (
        pytest.raises(OutputError, match="--overwrite"),
        atomic_folder(tmp_path / "out", overwrite=False),
    ):
        pytest.fail("the body ran")
    assert names(tmp_path / "out") == ["old"]


def test_overwriting_replaces_the_whole_folder(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old").write_bytes(b"old")
    with atomic_folder(tmp_path / "out", overwrite=True) as partial:
        (partial / "new").write_bytes(b"new")
        assert names(tmp_path / "out") == ["old"]
    assert names(tmp_path / "out") == ["new"]
    assert names(tmp_path) == ["out"]


def test_a_crash_leaves_the_old_folder_and_no_rest(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old").write_bytes(b"old")
    with pytest.raises(CrashError), atomic_folder(tmp_path / "out", overwrite=True) as partial:
        (partial / "half").write_bytes(b"half")
        raise CrashError
    assert names(tmp_path / "out") == ["old"]
    assert names(tmp_path) == ["out"]


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_file_in_the_place_of_the_folder_is_kept(tmp_path: Path, overwrite: bool) -> None:
    (tmp_path / "out").write_bytes(b"precious")
    with (
        pytest.raises(OutputError),
        atomic_folder(tmp_path / "out", overwrite=overwrite),
    ):
        pytest.fail("the body ran")
    assert (tmp_path / "out").read_bytes() == b"precious"
    assert names(tmp_path) == ["out"]


def test_a_folder_below_a_regular_file_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with (
        pytest.raises(OutputError, match="Cannot write"),
        atomic_folder(tmp_path / "file" / "out", overwrite=False),
    ):
        pytest.fail("the body ran")


def test_results_of_another_user_group_are_readable(tmp_path: Path) -> None:
    """mkstemp and mkdtemp make private things; results are not."""
    previous = os.umask(0o077)
    try:
        write_bytes(tmp_path / "a", b"")
    finally:
        os.umask(previous)
    assert (tmp_path / "a").stat().st_mode & 0o044 == 0o044
