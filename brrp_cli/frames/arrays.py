"""NumPy arrays from untrusted files: headers are read and judged before any data is."""

from __future__ import annotations

import lzma
import math
import tokenize
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import FrameError
from brrp_cli.files import is_file, trouble_of

# 12 megapixels as float32 points, uint8 colours and a mask fit; a 249 KB file can unpack to more.
MAX_BYTES = 128 * 2**20

_DAMAGE = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    EOFError,
    OSError,
    ValueError,
    NotImplementedError,  # a compression that Python does not know
    RuntimeError,  # an encrypted archive
    SyntaxError,  # a header that NumPy takes for one that Python 2 wrote
    tokenize.TokenError,
)


@contextmanager
def _damage_told(where: object, expected: str) -> Iterator[None]:
    try:
        yield
    except _DAMAGE as error:
        raise FrameError(
            "The file cannot be read",
            where=where,
            expected=expected,
            found=trouble_of(error),
            fix="it is damaged, cut short or not what its name says: write or fetch it again",
        ) from error


def check_file(path: Path) -> None:
    """FrameError unless `path` is a file."""
    if is_file(path):
        return
    try:
        there, folder = path.exists(), path.is_dir()
    except OSError:  # a name that no file system takes
        there, folder = False, False
    raise FrameError(
        "Not a file" if there else "No such file",
        where=path,
        fix="check the path; a folder is read by `brrp frame FOLDER -o FRAME.npz`"
        if folder
        else "check the path",
    )


def _read_header(stream: IO[bytes], where: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = np.lib.format.read_magic(stream)
    if version == (1, 0):
        shape, _, dtype = np.lib.format.read_array_header_1_0(stream)
    elif version == (2, 0):
        shape, _, dtype = np.lib.format.read_array_header_2_0(stream)
    else:
        raise ValueError(f"npy format version {version}")
    if dtype.hasobject:
        raise FrameError(
            "The array holds Python objects (a pickle), which are never loaded",
            where=where,
            expected="an array of numbers",
            found=f"dtype {dtype}",
            fix="save plain arrays: np.savez(path, depth=..., K=..., segmap=...)",
        )
    return shape, dtype


def _check_size(
    shape: tuple[int, ...], dtype: np.dtype[Any], spent: int, where: str, limit: int = MAX_BYTES
) -> int:
    total = spent + math.prod(shape) * dtype.itemsize
    if total > limit:
        raise FrameError(
            "The arrays are too large for one frame",
            where=where,
            expected=f"at most {limit} bytes in all",
            found=f"shape {shape}, dtype {dtype}: {total} bytes",
            fix="crop or downsample the frame, or store float32 and uint8 instead of float64",
        )
    return total


def read_npy(path: Path) -> NDArray[Any]:
    """The array of an .npy file.

    Errors: FrameError if it is missing, damaged, larger than `MAX_BYTES` or holds objects.
    """
    check_file(path)
    with _damage_told(path, "an .npy file"):
        with path.open("rb") as stream:
            shape, dtype = _read_header(stream, str(path))
            _check_size(shape, dtype, 0, str(path))
        return np.asarray(np.load(path, allow_pickle=False))


def read_npz(
    path: Path, accepted: frozenset[str], limit: int = MAX_BYTES
) -> tuple[Mapping[str, NDArray[Any]], list[str]]:
    """The arrays of an .npz file whose keys are in `accepted`, and the names of all its keys.

    Keys that nobody asked for are not read, whatever they hold. Every header is judged before the
    first array is loaded, so that a file that would unpack to much more than a frame is refused
    at once.

    Errors: FrameError if it is missing, damaged, larger than `limit` bytes or holds objects.
    """
    check_file(path)
    arrays: dict[str, NDArray[Any]] = {}
    with _damage_told(path, "an .npz file"), zipfile.ZipFile(path) as archive:
        members = {
            info.filename.removesuffix(".npy"): info
            for info in archive.infolist()
            if info.filename.endswith(".npy")
        }
        wanted = {key: info for key, info in members.items() if key in accepted}
        spent = 0
        for key, info in wanted.items():
            # Python bounds what one read unpacks for these two methods only.
            if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise NotImplementedError(f"{key} is compressed by method {info.compress_type}")
            where = f"{path}: {key}"
            with _damage_told(where, "a whole .npy member"), archive.open(info) as stream:
                shape, dtype = _read_header(stream, where)
                spent = _check_size(shape, dtype, spent, where, limit)
        for key, info in wanted.items():
            where = f"{path}: {key}"
            with _damage_told(where, "a whole .npy member"), archive.open(info) as stream:
                arrays[key] = np.lib.format.read_array(stream, allow_pickle=False)
    return arrays, sorted(members)
