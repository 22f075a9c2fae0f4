"""Bring files into a folder: checked against size and sha256 before they get their names."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from brrp_cli.errors import FetchError
from brrp_cli.fetch.download import download
from brrp_cli.files import cannot_write, fsync_folder, sha256_file
from brrp_cli.progress import byte_bar


@dataclass(frozen=True)
class RemoteFile:
    """A file that is known before it is here.

    path : relative, below the source and the folder; remote : below the source, where a repository
    has it elsewhere
    """

    path: str
    bytes: int
    sha256: str
    remote: str = ""


def fetch(
    files: Sequence[RemoteFile], source: str, folder: Path, *, label: str | None = None
) -> list[str]:
    """Make `folder` hold `files`; returns the paths that were not there yet.

    source : base of the addresses (http, https), or a folder that holds the files; label : of one
    bar for all files, in place of one for each. What was cut lies in PATH.part and is gone on with;
    what is there already is checked and kept. Errors: FetchError when a file cannot be had or is
    not the one that is meant; OutputError.
    """
    with only_fetch(folder):
        todo = [file for file in files if not is_there(folder / file.path, file)]
        if label is None:
            for file in todo:
                with byte_bar(file.bytes, Path(file.path).name) as advance:
                    _fetch_one(file, source, folder / file.path, advance)
        elif todo:
            with byte_bar(sum(file.bytes for file in todo), label) as advance:
                for file in todo:
                    _fetch_one(file, source, folder / file.path, advance)
    return [file.path for file in todo]


def _fetch_one(file: RemoteFile, source: str, path: Path, advance: Callable[[int], None]) -> None:
    part = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if is_address(source):
            address = f"{source.rstrip('/')}/{file.remote or file.path}"
            download(address, part, file.bytes, advance)
        else:
            places = [Path(source) / place for place in (file.path, file.remote) if place]
            here = next((place for place in places if place.is_file()), places[0])
            address = str(here)
            _copy(here, part)
            advance(file.bytes)
        check(part, file, address)
        part.replace(path)
        fsync_folder(path.parent)
    except OSError as error:
        raise cannot_write(path, error) from error


def is_address(source: str) -> bool:
    """Whether `source` is a web address; if not, it is a folder."""
    return source.startswith(("http://", "https://"))


def _copy(source: Path, part: Path) -> None:
    if not source.is_file():
        raise FetchError(
            "The folder does not hold the file",
            where=source,
            fix="--from takes a web address, or a folder laid out as the repository is",
        )
    shutil.copyfile(source, part)


def check(part: Path, file: RemoteFile, address: str) -> None:
    """FetchError, and no file, unless these are the bytes that are meant."""
    size, digest = part.stat().st_size, sha256_file(part)
    if (size, digest) == (file.bytes, file.sha256):
        return
    part.unlink()
    raise FetchError(
        "The file is not the one that was asked for, and was deleted",
        where=address,
        expected=f"{file.bytes} bytes, sha256 {file.sha256}",
        found=f"{size} bytes, sha256 {digest}",
        fix="run the command again; if it repeats, the source holds another file: choose one with "
        "--from",
    )


def is_there(path: Path, file: RemoteFile) -> bool:
    """Whether the file is there already, with its size and sum."""
    return path.is_file() and path.stat().st_size == file.bytes and sha256_file(path) == file.sha256


@contextmanager
def only_fetch(folder: Path) -> Iterator[None]:
    """Make the folder and hold its lock, or tell at once that another fetch holds it."""
    import filelock

    try:
        folder.mkdir(parents=True, exist_ok=True)
        with filelock.FileLock(folder / ".lock", timeout=0):
            yield
    except filelock.Timeout as error:
        raise FetchError(
            "Another fetch is at work on this folder", where=folder, fix="wait until it has ended"
        ) from error
    except OSError as error:
        raise cannot_write(folder, error) from error
