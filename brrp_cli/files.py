"""Files that are whole or absent: write beside, fsync, rename."""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from brrp_cli.errors import OutputError


def sha256_file(path: Path) -> str:
    """Hex sha256 of a file's bytes."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def fsync_folder(folder: Path) -> None:
    """Make renames inside `folder` durable."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def cannot_write(path: Path, error: OSError) -> OutputError:
    """The message for an OSError met while writing `path`."""
    return OutputError(
        "Cannot write",
        where=path,
        found=error.strerror or str(error),
        fix="check the folder's permissions and the free space on the disk, or choose another -o",
    )


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Yield a temporary path in `path`'s folder; on success fsync it and rename it to `path`.

    The target never exists half written. Errors of the file system become OutputError.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor, name = tempfile.mkstemp(
            dir=path.parent, prefix=f".{path.stem}.", suffix=f".partial{path.suffix}"
        )
        os.fchmod(descriptor, 0o644)
        os.close(descriptor)
    except OSError as error:
        raise cannot_write(path, error) from error
    partial = Path(name)
    try:
        yield partial
        with partial.open("rb") as stream:
            os.fsync(stream.fileno())
        partial.replace(path)
        fsync_folder(path.parent)
    except OSError as error:
        raise cannot_write(path, error) from error
    finally:
        partial.unlink(missing_ok=True)


def write_bytes(path: Path, data: bytes) -> None:
    """Write a whole file, or leave what was there."""
    with atomic_path(path) as partial:
        partial.write_bytes(data)


def refuse_existing(path: Path, *, overwrite: bool) -> None:
    """OutputError if `path` is there and may not be replaced."""
    if path.exists() and not overwrite:
        raise OutputError(
            "The output exists already",
            where=path,
            fix="pass --overwrite to replace it, or choose another place with -o",
        )


def check_writable(folder: Path) -> None:
    """OutputError if no file can be made in `folder`, which is made if it is missing."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise cannot_write(folder, error) from error


@contextmanager
def atomic_folder(folder: Path, *, overwrite: bool) -> Iterator[Path]:
    """Yield a temporary folder beside `folder`; on success it takes the place of `folder`.

    Errors: OutputError if `folder` exists and `overwrite` is false, if it is a file, or on any
    OSError.
    """
    if folder.exists() and not folder.is_dir():
        raise OutputError(
            "The output folder is a file", where=folder, fix="choose another folder with -o"
        )
    refuse_existing(folder, overwrite=overwrite)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        partial = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}.partial."))
        partial.chmod(0o755)
    except OSError as error:
        raise cannot_write(folder, error) from error
    try:
        yield partial
        for path in partial.rglob("*"):
            if path.is_file():
                with path.open("rb") as stream:
                    os.fsync(stream.fileno())
        if folder.exists():
            replaced = partial.with_name(partial.name + ".replaced")
            folder.rename(replaced)
            partial.rename(folder)
            shutil.rmtree(replaced)
        else:
            partial.rename(folder)
        fsync_folder(folder.parent)
    except OSError as error:
        raise cannot_write(folder, error) from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)
