"""Files fetched from a real server on this machine: whole and right, or not there."""

from __future__ import annotations

import hashlib
import socket
from pathlib import Path

import filelock
import numpy as np
import pytest
from serving import Plan, serving

from brrp_cli.errors import FetchError, OutputError
from brrp_cli.fetch import download
from brrp_cli.fetch.fetch import RemoteFile, fetch

DATA = np.random.default_rng(0).bytes(1_000_000)
OTHER = DATA[:-1] + bytes([DATA[-1] ^ 1])
NAME = "onnx/model.onnx"
# Where connections are cut: at whole chunks, as a cut loses the one that is under way.
CUT = 4 * download.CHUNK


def remote(data: bytes = DATA, name: str = NAME) -> RemoteFile:
    return RemoteFile(name, len(data), hashlib.sha256(data).hexdigest())


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """No pause between tries, and no proxy between this machine and itself."""
    monkeypatch.setattr(download, "PAUSE", 0)
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")


def left(folder: Path) -> list[str]:
    """Every file but the lock."""
    files = (p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())
    return sorted(name for name in files if name != ".lock")


def test_a_file_comes_whole_and_is_not_fetched_twice(tmp_path: Path) -> None:
    plan = Plan({NAME: DATA})
    with serving(plan) as address:
        assert fetch([remote()], address, tmp_path) == [NAME]
        assert fetch([remote()], address + "/", tmp_path) == []
    assert (tmp_path / NAME).read_bytes() == DATA
    assert left(tmp_path) == [NAME]
    assert plan.asked == [None]


@pytest.mark.parametrize("chunked", [False, True])
def test_a_cut_connection_goes_on_at_the_byte_it_had(tmp_path: Path, chunked: bool) -> None:
    """Also where the server does not say how much is to come."""
    plan = Plan({NAME: DATA}, cuts=[CUT, 0, CUT], chunked=chunked)
    with serving(plan) as address:
        fetch([remote()], address, tmp_path)
    assert (tmp_path / NAME).read_bytes() == DATA
    assert plan.asked == [None, *(f"bytes={byte}-" for byte in (CUT, CUT, 2 * CUT))]


def test_what_came_before_the_command_gave_up_is_kept(tmp_path: Path) -> None:
    plan = Plan({NAME: DATA}, cuts=[CUT, 0, 0, 0])
    with serving(plan) as address:
        with pytest.raises(FetchError, match=rf"{CUT} of 1000000 bytes, which are kept") as caught:
            fetch([remote()], address, tmp_path)
        assert left(tmp_path) == [NAME + ".part"]
        fetch([remote()], address, tmp_path)
    assert "same command again" in str(caught.value.fix)
    assert (tmp_path / NAME).read_bytes() == DATA
    assert left(tmp_path) == [NAME]
    assert plan.asked[-1] == f"bytes={CUT}-"


def test_a_server_that_ignores_ranges_sends_all_again(tmp_path: Path) -> None:
    plan = Plan({NAME: DATA}, cuts=[CUT], ranges=False)
    with serving(plan) as address:
        fetch([remote()], address, tmp_path)
    assert (tmp_path / NAME).read_bytes() == DATA
    assert plan.asked == [None, f"bytes={CUT}-"]


def test_a_server_that_always_breaks_off_at_one_place_is_given_up(tmp_path: Path) -> None:
    plan = Plan({NAME: DATA}, cuts=[CUT] * 10, ranges=False)
    with serving(plan) as address, pytest.raises(FetchError, match="was cut"):
        fetch([remote()], address, tmp_path)
    assert len(plan.asked) == 1 + download.TRIES


@pytest.mark.parametrize("status", [429, 500, 503])
def test_a_server_that_is_busy_is_asked_again(tmp_path: Path, status: int) -> None:
    with serving(Plan({NAME: DATA}, statuses=[status, status])) as address:
        fetch([remote()], address, tmp_path)
    assert (tmp_path / NAME).read_bytes() == DATA


def test_a_wrong_sum_is_refused_and_nothing_is_left(tmp_path: Path) -> None:
    with (
        serving(Plan({NAME: OTHER})) as address,
        pytest.raises(FetchError, match="not the one that was asked for") as caught,
    ):
        fetch([remote()], address, tmp_path)
    assert hashlib.sha256(DATA).hexdigest() in str(caught.value.expected)
    assert hashlib.sha256(OTHER).hexdigest() in str(caught.value.found)
    assert left(tmp_path) == []


def test_a_part_of_another_file_is_found_out_and_fetched_anew(tmp_path: Path) -> None:
    part = tmp_path / (NAME + ".part")
    part.parent.mkdir()
    part.write_bytes(b"?" * 1000)
    with serving(Plan({NAME: DATA})) as address:
        with pytest.raises(FetchError, match="not the one that was asked for"):
            fetch([remote()], address, tmp_path)
        fetch([remote()], address, tmp_path)
    assert (tmp_path / NAME).read_bytes() == DATA


def test_a_part_longer_than_the_file_is_dropped(tmp_path: Path) -> None:
    part = tmp_path / (NAME + ".part")
    part.parent.mkdir()
    part.write_bytes(DATA + b"?")
    plan = Plan({NAME: DATA})
    with serving(plan) as address:
        fetch([remote()], address, tmp_path)
    assert (tmp_path / NAME).read_bytes() == DATA
    assert plan.asked == [None]


def test_a_damaged_file_that_is_there_is_fetched_anew(tmp_path: Path) -> None:
    (tmp_path / NAME).parent.mkdir()
    (tmp_path / NAME).write_bytes(OTHER)
    with serving(Plan({NAME: DATA})) as address:
        assert fetch([remote()], address, tmp_path) == [NAME]
    assert (tmp_path / NAME).read_bytes() == DATA


@pytest.mark.parametrize("chunked", [False, True])
@pytest.mark.parametrize("page", [b"<html>log in</html>", DATA * 2])
def test_another_file_under_the_address_is_refused(
    tmp_path: Path, page: bytes, chunked: bool
) -> None:
    with (
        serving(Plan({NAME: page}, chunked=chunked)) as address,
        pytest.raises(FetchError, match=r"1000000 bytes") as caught,
    ):
        fetch([remote()], address, tmp_path)
    assert caught.value.where == f"{address}/{NAME}"
    assert NAME not in left(tmp_path)


def test_a_range_that_begins_elsewhere_is_refused(tmp_path: Path) -> None:
    plan = Plan({NAME: DATA}, cuts=[CUT], shift=5)
    with serving(plan) as address, pytest.raises(FetchError, match="another part") as caught:
        fetch([remote()], address, tmp_path)
    assert str(CUT + 5) in str(caught.value.found)
    assert NAME not in left(tmp_path)


def test_a_missing_file_names_its_address(tmp_path: Path) -> None:
    with serving(Plan({})) as address, pytest.raises(FetchError, match="404") as caught:
        fetch([remote()], address, tmp_path)
    assert caught.value.where == f"{address}/{NAME}"
    assert left(tmp_path) == []


def test_no_server_says_what_to_do_without_a_network(tmp_path: Path) -> None:
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        port = held.getsockname()[1]
        with pytest.raises(FetchError, match=f"127.0.0.1:{port} cannot be reached") as caught:
            fetch([remote()], f"http://127.0.0.1:{port}", tmp_path)
    assert "refused" in str(caught.value.found)
    assert "--clip-dir" in str(caught.value.fix)


def test_a_name_that_does_not_resolve_is_told_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(FetchError, match=r"nowhere\.invalid cannot be reached") as caught:
        fetch([remote()], "http://nowhere.invalid", tmp_path)
    assert "\n" not in str(caught.value.found)


def test_a_folder_serves_as_well(tmp_path: Path) -> None:
    source = tmp_path / "stick"
    (source / NAME).parent.mkdir(parents=True)
    (source / NAME).write_bytes(DATA)
    fetch([remote()], str(source), tmp_path / "here")
    assert (tmp_path / "here" / NAME).read_bytes() == DATA
    with pytest.raises(FetchError, match=r"does not hold[\s\S]*other\.onnx"):
        fetch([remote(name="other.onnx")], str(source), tmp_path / "here")


def test_files_before_one_that_fails_stay(tmp_path: Path) -> None:
    files = [remote(DATA, "a.onnx"), remote(DATA, "b.onnx")]
    with serving(Plan({"a.onnx": DATA})) as address, pytest.raises(FetchError, match="404"):
        fetch(files, address, tmp_path)
    assert left(tmp_path) == ["a.onnx"]


def test_a_second_fetch_into_one_folder_is_refused(tmp_path: Path) -> None:
    with (
        filelock.FileLock(tmp_path / ".lock"),
        serving(Plan({NAME: DATA})) as address,
        pytest.raises(FetchError, match="Another fetch"),
    ):
        fetch([remote()], address, tmp_path)


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="file"):
        fetch([remote()], "http://127.0.0.1:9", tmp_path / "file" / "clip")
