"""Files that are whole or absent: write beside, fsync, rename."""

from __future__ import annotations

import ctypes
import errno
import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from brrp_cli.errors import OutputError
from brrp_cli.spoken import either

# What file systems without such a thing say.
_NOT_SUPPORTED = {errno.EINVAL, errno.ENOSYS, errno.ENOTSUP}
_RENAME_EXCHANGE = 2
_DIGITS = 18
_AT_FDCWD = -100
# What Python and NumPy say of text, and of so many values as do not belong there.
_NO_NUMBER = "could not convert string to float: "
_OTHER_COUNT = ("cannot reshape", "inhomogeneous", "setting an array element")


def sha256_file(path: Path) -> str:
    """Hex sha256 of a file's bytes."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def is_file(path: Path) -> bool:
    """Whether a path, of which a file or a user told the name, is a file; no name is an error."""
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that no file system takes
        return False


def exists(path: Path) -> bool:
    """Whether there is anything at a path that a user told; no name is an error."""
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def read_text(path: Path) -> str:
    """UTF-8 text of a file that may be anything, without the mark that some editors begin it with.
    Errors: OSError; ValueError."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError("bytes that are no UTF-8 text") from error


def trouble_of(error: Exception) -> str:
    """What an error of a file, or over what is in it, says: in words, on one line, without the path
    that `where` tells and without the names of Python's errors."""
    said = " ".join(str(error).split())
    match error:
        case OSError(strerror=str(why)):
            return why
        case KeyError(args=(str(key),)):
            return key if " " in key else f"no {key}"
        case UnicodeDecodeError():
            return "bytes that are no UTF-8 text"
        case TypeError() | AttributeError():
            return "a value of another kind"
        case IndexError():
            return "too few values"
        case OverflowError():
            return "a number that is too large"
    if said.startswith(_NO_NUMBER):
        return f"{said.removeprefix(_NO_NUMBER)}, which is no number"
    if any(words in said for words in _OTHER_COUNT):
        return "another number of values"
    if "pickle" in said:  # NumPy advises to load it unsafely
        return "bytes that are no NumPy array"
    return said or "damaged bytes"


def parse_json(text: str | bytes) -> Any:
    """JSON from a file that may be anything. Errors: ValueError."""
    try:
        return json.loads(text, parse_int=_int64)
    except RecursionError as error:
        raise ValueError("brackets within brackets without an end") from error


def _int64(digits: str) -> int:
    """What no NumPy integer and no float can hold is no number of ours."""
    if len(digits) > _DIGITS:
        raise ValueError(f"an integer of {len(digits)} digits")
    return int(digits)


def fsync_folder(folder: Path) -> None:
    """Make renames inside `folder` durable, where the file system can do that."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in _NOT_SUPPORTED:
            raise
    finally:
        os.close(descriptor)


def exchange(first: Path, second: Path) -> None:
    """Swap two names of one file system, so that neither is ever without a file.

    Errors: OSError, with an errno of "not supported" where the system cannot do it in one step.
    """
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except AttributeError:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS)) from None
    names = os.fsencode(first), os.fsencode(second)
    if rename(_AT_FDCWD, names[0], _AT_FDCWD, names[1], _RENAME_EXCHANGE) != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number), str(first), None, str(second))


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
        with suppress(OSError):
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
            fix=either(
                "pass --overwrite to replace it, or choose another place with -o",
                "pass overwrite=True to replace it, or choose another place",
            ),
        )


def check_writable(folder: Path) -> None:
    """OutputError if no file can be made in `folder`, which is made if it is missing."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise cannot_write(folder, error) from error


def refuse_folder(folder: Path, *, overwrite: bool, mark: str) -> None:
    """OutputError if `folder` may not be replaced: it is there without `overwrite`, it is a file,
    or it is neither empty nor holds the file `mark`, so that it is nothing that brrp wrote.
    """
    refuse_existing(folder, overwrite=overwrite)
    if not folder.exists():
        return
    if not folder.is_dir():
        raise OutputError(
            "The output folder is a file", where=folder, fix="choose another folder with -o"
        )
    if any(folder.iterdir()) and not (folder / mark).exists():
        raise OutputError(
            "The output folder holds other things, and --overwrite would delete them",
            where=folder,
            expected=f"an empty folder, or one with {mark} in it from an earlier run",
            fix="choose another folder with -o, or delete this one yourself",
        )


@contextmanager
def atomic_folder(folder: Path, *, overwrite: bool, mark: str) -> Iterator[Path]:
    """Yield a temporary folder beside `folder`; on success it takes the place of `folder`.

    mark : a file that every such folder holds; what lacks it is never replaced. Errors: OutputError
    if `folder` may not be replaced, or on any OSError.
    """
    refuse_folder(folder, overwrite=overwrite, mark=mark)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        partial = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}.partial."))
        partial.chmod(0o755)
    except OSError as error:
        raise cannot_write(folder, error) from error
    try:
        yield partial
        _fsync_tree(partial)
        if folder.exists():
            _take_the_place(partial, folder)
        else:
            partial.rename(folder)
        fsync_folder(folder.parent)
    except OSError as error:
        raise cannot_write(folder, error) from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _fsync_tree(folder: Path) -> None:
    for path in [*folder.rglob("*"), folder]:
        if path.is_dir():
            fsync_folder(path)
        else:
            with path.open("rb") as stream:
                os.fsync(stream.fileno())


def _take_the_place(partial: Path, folder: Path) -> None:
    """`partial` becomes `folder`, whose old content is what `partial` holds then or is gone."""
    try:
        exchange(partial, folder)
    except OSError as error:
        if error.errno not in _NOT_SUPPORTED:
            raise
        # Not in one step: a kill between the two leaves both, whole, beside the place.
        replaced = partial.with_name(partial.name + ".replaced")
        folder.rename(replaced)
        try:
            partial.rename(folder)
        except OSError:
            replaced.rename(folder)
            raise
        shutil.rmtree(replaced, ignore_errors=True)
