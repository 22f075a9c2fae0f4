"""Files that a source has in a tar archive: brought, taken out one by one, and checked."""

from __future__ import annotations

import gzip
import posixpath
import shutil
import tarfile
import zlib
from collections.abc import Sequence
from pathlib import Path

from brrp_cli.errors import FetchError
from brrp_cli.fetch.download import download, remote_size
from brrp_cli.fetch.fetch import RemoteFile, check, is_address, is_there
from brrp_cli.files import cannot_write, fsync_folder
from brrp_cli.progress import byte_bar

# A picture whose sum is not known: what it begins with, and the most that is taken.
_PNG = b"\x89PNG\r\n\x1a\n"
_MOST = 2**27


def is_complete(folder: Path, files: Sequence[RemoteFile]) -> bool:
    """Whether all of the files are there already."""
    return all(
        is_there(folder / file.path, file) if file.sha256 else _is_png(folder / file.path)
        for file in files
    )


def find_archive(source: str, archive: str) -> Path | None:
    """The archive in a folder that holds archives, with or without the address's folders."""
    places = [Path(source) / archive, Path(source) / posixpath.basename(archive)]
    return next((place for place in places if place.is_file()), None)


def fetch_archive(
    choices: Sequence[Sequence[RemoteFile]], source: str, archive: str, folder: Path
) -> list[RemoteFile]:
    """Bring one archive, take files out of it into `folder`, and delete it; returns the files.

    choices : what the archive may hold, the most wanted first; a file without a sum is a PNG that
    is taken as it comes. source : base of the address, or a folder with the archive. An archive
    that was cut lies in NAME.part and is gone on with. Errors: FetchError, OutputError.
    """
    part = folder / f".{posixpath.basename(archive)}.part"
    try:
        if not is_address(source):
            path = find_archive(source, archive)
            if path is None:
                raise FetchError("The folder does not hold the archive", where=source)
            return _unpack(path, choices, str(path), folder)
        address = f"{source.rstrip('/')}/{archive}"
        size = remote_size(address)
        with byte_bar(size, posixpath.basename(archive)) as advance:
            download(address, part, size, advance)
        try:
            return _unpack(part, choices, address, folder)
        finally:
            # Used up, or of no use: its own sum is not known, so that it cannot be mended.
            part.unlink(missing_ok=True)
    except OSError as error:
        raise cannot_write(folder, error) from error


def _unpack(
    archive: Path, choices: Sequence[Sequence[RemoteFile]], address: str, folder: Path
) -> list[RemoteFile]:
    try:
        with tarfile.open(archive, "r:gz") as tar:
            members = {posixpath.normpath(m.name): m for m in tar.getmembers() if m.isfile()}
            files = next((c for c in choices if all(f.path in members for f in c)), None)
            if files is None:
                raise FetchError(
                    "The archive lacks a file",
                    where=address,
                    expected=" or ".join(", ".join(f.path for f in c) for c in choices),
                    found=", ".join(sorted(members)[:10]) or "no files",
                    fix="choose another source with --from",
                )
            for file in files:
                _take_out(tar, members[file.path], file, address, folder / file.path)
    except (tarfile.TarError, EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise FetchError(
            "The archive cannot be read",
            where=address,
            found=error,
            fix="run the command again; if it repeats, choose another source with --from",
        ) from error
    return list(files)


def _take_out(
    tar: tarfile.TarFile, member: tarfile.TarInfo, file: RemoteFile, address: str, path: Path
) -> None:
    if member.size > (file.bytes if file.sha256 else _MOST):
        raise _not_meant(file, address, f"{member.size} bytes")
    stream = tar.extractfile(member)
    if stream is None:
        raise _not_meant(file, address, "no file")
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    with part.open("wb") as out:
        shutil.copyfileobj(stream, out)
    if file.sha256:
        check(part, file, f"{address}, {file.path}")
    elif not _is_png(part):
        part.unlink()
        raise _not_meant(file, address, "no PNG")
    part.replace(path)
    fsync_folder(path.parent)


def _is_png(path: Path) -> bool:
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        return stream.read(len(_PNG)) == _PNG


def _not_meant(file: RemoteFile, address: str, found: str) -> FetchError:
    return FetchError(
        "The archive holds another file than the one that is meant",
        where=f"{address}, {file.path}",
        expected=f"{file.bytes} bytes" if file.sha256 else f"a PNG of at most {_MOST} bytes",
        found=found,
        fix="choose another source with --from",
    )
