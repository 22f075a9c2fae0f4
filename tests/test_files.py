import errno
import os
import shutil
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from file_faults import Steps, fail_at, in_a_process, kill_at, watched

from brrp_cli import files
from brrp_cli.errors import OutputError
from brrp_cli.files import atomic_folder, atomic_path, sha256_file, write_bytes

MARK = "old"


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
    with atomic_folder(target, overwrite=False, mark=MARK) as partial:
        (partial / "meshes").mkdir()
        (partial / "meshes" / "7.ply").write_bytes(b"ply")
        assert not target.exists()
    assert (target / "meshes" / "7.ply").read_bytes() == b"ply"
    assert names(target.parent) == ["out"]
    assert target.stat().st_mode & 0o777 == 0o755


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_folder_that_brrp_did_not_write_is_never_replaced(
    tmp_path: Path, overwrite: bool
) -> None:
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter1").write_bytes(b"years of work")
    with (
        pytest.raises(OutputError),
        atomic_folder(tmp_path / "thesis", overwrite=overwrite, mark=MARK),
    ):
        pytest.fail("the body ran")
    assert names(tmp_path / "thesis") == ["chapter1"]


def test_an_empty_folder_may_be_filled(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with atomic_folder(tmp_path / "out", overwrite=True, mark=MARK) as partial:
        (partial / "new").write_bytes(b"new")
    assert names(tmp_path / "out") == ["new"]


def test_an_existing_folder_is_refused_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old").write_bytes(b"old")
    with (
        pytest.raises(OutputError, match="overwrite=True"),
        atomic_folder(tmp_path / "out", overwrite=False, mark=MARK),
    ):
        pytest.fail("the body ran")
    assert names(tmp_path / "out") == ["old"]


def test_overwriting_replaces_the_whole_folder(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old").write_bytes(b"old")
    with atomic_folder(tmp_path / "out", overwrite=True, mark=MARK) as partial:
        (partial / "new").write_bytes(b"new")
        assert names(tmp_path / "out") == ["old"]
    assert names(tmp_path / "out") == ["new"]
    assert names(tmp_path) == ["out"]


def test_a_crash_leaves_the_old_folder_and_no_rest(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old").write_bytes(b"old")
    with (
        pytest.raises(CrashError),
        atomic_folder(tmp_path / "out", overwrite=True, mark=MARK) as partial,
    ):
        (partial / "half").write_bytes(b"half")
        raise CrashError
    assert names(tmp_path / "out") == ["old"]
    assert names(tmp_path) == ["out"]


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_file_in_the_place_of_the_folder_is_kept(tmp_path: Path, overwrite: bool) -> None:
    (tmp_path / "out").write_bytes(b"precious")
    with (
        pytest.raises(OutputError),
        atomic_folder(tmp_path / "out", overwrite=overwrite, mark=MARK),
    ):
        pytest.fail("the body ran")
    assert (tmp_path / "out").read_bytes() == b"precious"
    assert names(tmp_path) == ["out"]


def test_a_folder_below_a_regular_file_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with (
        pytest.raises(OutputError, match="Cannot write"),
        atomic_folder(tmp_path / "file" / "out", overwrite=False, mark=MARK),
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


def result_folder(out: Path, text: str) -> None:
    """Results as a command writes them: several files, over what was there."""
    with atomic_folder(out, overwrite=True, mark=MARK) as partial:
        (partial / MARK).write_bytes(text.encode())
        (partial / "meshes").mkdir()
        for i in range(3):
            (partial / "meshes" / f"{i}.ply").write_bytes(1000 * text.encode())


def whole_result(out: Path, text: str) -> bool:
    wanted = {MARK, *(f"meshes/{i}.ply" for i in range(3))}
    found = {path.relative_to(out).as_posix(): path.read_text() for path in files_of(out)}
    return found.keys() == wanted and all(t in (text, 1000 * text) for t in found.values())


def files_of(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


@pytest.mark.parametrize("over", [False, True], ids=["new", "over others"])
def test_results_are_whole_or_not_there_wherever_the_process_is_killed(
    over: bool, tmp_path: Path
) -> None:
    out = tmp_path / "here" / "out"
    steps = Steps(tmp_path)
    with watched(steps):
        result_folder(out, "new")
    assert len(steps.done) >= 18
    for number in range(len(steps.done)):
        shutil.rmtree(tmp_path / "here", ignore_errors=True)
        if over:
            result_folder(out, "old")

        def work(number: int = number) -> None:
            with watched(Steps(tmp_path, kill_at(number))):
                result_folder(out, "new")

        assert in_a_process(work) in (0, -9)
        if over:
            assert whole_result(out, "old") or whole_result(out, "new"), steps.done[number]
        else:
            assert not out.exists() or whole_result(out, "new")
        result_folder(out, "new")
        assert whole_result(out, "new")


@pytest.mark.parametrize("over", [False, True], ids=["new", "over others"])
def test_results_are_whole_or_not_there_wherever_a_step_fails(over: bool, tmp_path: Path) -> None:
    out = tmp_path / "here" / "out"
    steps = Steps(tmp_path)
    with watched(steps):
        result_folder(out, "new")
    for number in range(len(steps.done)):
        shutil.rmtree(tmp_path / "here", ignore_errors=True)
        if over:
            result_folder(out, "old")
        with watched(Steps(tmp_path, fail_at(number))), suppress(OutputError, OSError):
            result_folder(out, "new")
        kept = whole_result(out, "old") if over else not out.exists()
        assert kept or whole_result(out, "new"), steps.done[number]


def test_where_two_names_cannot_be_exchanged_a_folder_is_replaced_in_two_steps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def cannot(first: Path, second: Path) -> None:
        raise OSError(errno.EINVAL, "no such thing on this file system")

    monkeypatch.setattr(files, "exchange", cannot)
    result_folder(tmp_path / "out", "old")
    result_folder(tmp_path / "out", "new")
    assert whole_result(tmp_path / "out", "new") and names(tmp_path) == ["out"]


def test_names_are_exchanged_in_one_step(tmp_path: Path) -> None:
    for name in "ab":
        (tmp_path / name).mkdir()
        (tmp_path / name / name).touch()
    files.exchange(tmp_path / "a", tmp_path / "b")
    assert names(tmp_path / "a") == ["b"] and names(tmp_path / "b") == ["a"]
    with pytest.raises(OSError, match="No such file"):
        files.exchange(tmp_path / "a", tmp_path / "none")


@pytest.mark.parametrize("text", ["[" * 10**5, '{"a": 1' + "0" * 400 + "}", "{", ""])
def test_json_of_any_kind_is_a_value_error(text: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        files.parse_json(text)
    assert files.parse_json('{"a": [1, -2.5, 999999999999999999]}')["a"][2] == 999999999999999999


@pytest.mark.parametrize(
    ("raised", "said"),
    [
        (lambda: {}["scale"], "no scale"),
        (lambda: [][1], "too few values"),
        (lambda: iter(3), "a value of another kind"),
        (lambda: None.items(), "a value of another kind"),
        (lambda: float("one"), "'one', which is no number"),
        (lambda: int(float("inf")), "a number that is too large"),
        (lambda: b"\xff".decode(), "bytes that are no UTF-8 text"),
        (lambda: np.zeros(4).reshape(3, 3), "another number of values"),
        (lambda: np.array([[1, 2], [3]], float), "another number of values"),
        (lambda: Path("/none/there").read_text(), "No such file or directory"),
        (lambda: next(iter([])), "damaged bytes"),
    ],
)
def test_what_is_wrong_with_a_file_is_said_in_words(raised, said) -> None:
    with pytest.raises(Exception) as caught:
        raised()
    assert files.trouble_of(caught.value) == said
