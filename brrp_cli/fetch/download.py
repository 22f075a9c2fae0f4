"""One file over HTTP into a .part file that is gone on with after a cut.

requests does the transfer, proxies and redirects; what it has not is going on with a file that is
there in part (HTTP range requests, RFC 9110 section 14).
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from brrp_cli.dependencies import import_library
from brrp_cli.errors import FetchError

if TYPE_CHECKING:
    import requests

# Tries in a row that bring nothing new, and seconds before the second of them (then twice that).
TRIES = 3
PAUSE = 1.0
# Seconds for a connection, and for the next bytes of one that is open.
TIMEOUT = (10, 60)
# A cut loses the last chunk at most.
CHUNK = 2**16


class _CutError(Exception):
    """A transfer that ended early and is worth another try."""


def download(url: str, part: Path, size: int, advance: Callable[[int], None]) -> None:
    """Bring the `size` bytes of `url` into `part`, which may hold the first of them already.

    advance : told how many bytes more, or fewer, are there. Errors: FetchError when the server
    cannot be reached, does not have the file, or has one of another size; OSError. `part` is kept
    except where its bytes are of no use.
    """
    requests = import_library("requests")
    best = have = _length(part, size)
    idle = 0
    advance(have)
    with requests.Session() as session:
        # Not compressed on the way: the server's byte numbers must be those of the file.
        session.headers["Accept-Encoding"] = "identity"
        while have < size:
            try:
                _receive(session, url, part, have, size, advance)
            except (requests.RequestException, _CutError) as error:
                have = _length(part, size)
                idle = 0 if have > best else idle + 1
                best = max(best, have)
                if idle >= TRIES or not _worth_a_try(error):
                    raise _failed(url, part, size, error) from error
                time.sleep(PAUSE * 2 ** max(idle - 1, 0))
            have = _length(part, size)


def remote_size(url: str) -> int:
    """Bytes of the file at `url`, as its server tells before it sends it. Errors: FetchError."""
    requests = import_library("requests")
    for tries in range(1, TRIES + 1):
        try:
            headers = {"Accept-Encoding": "identity"}
            with requests.get(url, headers=headers, stream=True, timeout=TIMEOUT) as answer:
                if answer.status_code == 429 or answer.status_code >= 500:
                    raise _CutError(f"HTTP {answer.status_code} {answer.reason}")
                if answer.status_code != 200:
                    raise _not_given(url, answer)
                length = answer.headers.get("Content-Length", "")
        except (requests.RequestException, _CutError) as error:
            if tries == TRIES or not _worth_a_try(error):
                raise _unreachable(url, error) from error
            time.sleep(PAUSE * 2 ** (tries - 1))
        else:
            break
    if not length.isdigit():
        raise FetchError(
            "The server does not say how large the file is",
            where=url,
            fix="choose another source with --from",
        )
    return int(length)


def _length(part: Path, size: int) -> int:
    """Bytes that are there; a part longer than the file is of another one and goes."""
    have = part.stat().st_size if part.exists() else 0
    if have > size:
        part.unlink()
        return 0
    return have


def _receive(
    session: requests.Session,
    url: str,
    part: Path,
    have: int,
    size: int,
    advance: Callable[[int], None],
) -> None:
    """One request: append to `part`, or begin it anew where the server ignores the range."""
    ranged = {"Range": f"bytes={have}-"} if have else {}
    with session.get(url, headers=ranged, stream=True, timeout=TIMEOUT) as answer:
        if answer.status_code == 416:
            part.unlink(missing_ok=True)
            advance(-have)
            raise _CutError(f"the server has no byte {have}")
        if answer.status_code == 429 or answer.status_code >= 500:
            raise _CutError(f"HTTP {answer.status_code} {answer.reason}")
        if answer.status_code not in (200, 206):
            raise _not_given(url, answer)
        _refuse_other_size(answer, url, have, size)
        goes_on = answer.status_code == 206
        if not goes_on:
            advance(-have)
        with part.open("ab" if goes_on else "wb") as stream:
            for chunk in answer.iter_content(CHUNK):
                if stream.tell() + len(chunk) > size:
                    part.unlink()
                    raise _other_size(url, size, f"more than {size} bytes")
                stream.write(chunk)
                advance(len(chunk))
            if stream.tell() < size:
                raise _CutError("the connection was closed early")


def _refuse_other_size(answer: requests.Response, url: str, have: int, size: int) -> None:
    """What the answer's head says of the whole file, before a byte is written."""
    if answer.status_code == 206:
        told = re.fullmatch(r"bytes (\d+)-\d+/(\d+|\*)", answer.headers.get("Content-Range", ""))
        if told is None or int(told[1]) != have:
            raise FetchError(
                "The server answers with another part of the file than was asked for",
                where=url,
                expected=f"from byte {have}",
                found=answer.headers.get("Content-Range", "no Content-Range"),
                fix="choose another source with --from",
            )
        whole = told[2]
    else:
        whole = answer.headers.get("Content-Length", "*")
    if whole.isdigit() and int(whole) != size:
        raise _other_size(url, size, f"{whole} bytes")


def _other_size(url: str, size: int, found: str) -> FetchError:
    return FetchError(
        "The server has another file under this address",
        where=url,
        expected=f"{size} bytes",
        found=found,
        fix="check the address; --from names another one. A network that asks for a login answers "
        "with a page of its own",
    )


def _not_given(url: str, answer: requests.Response) -> FetchError:
    return FetchError(
        "The server does not give the file",
        where=url,
        found=f"HTTP {answer.status_code} {answer.reason}",
        fix="check the address; --from names another one",
    )


def _worth_a_try(error: Exception) -> bool:
    requests = import_library("requests")
    lasting = (requests.exceptions.InvalidURL, requests.exceptions.SSLError)
    return not isinstance(error, lasting)


def _failed(url: str, part: Path, size: int, error: Exception) -> FetchError:
    requests = import_library("requests")
    have = part.stat().st_size if part.exists() else 0
    if have or not isinstance(error, requests.ConnectionError | requests.Timeout):
        return FetchError(
            "The download was cut",
            where=url,
            found=f"{have} of {size} bytes, which are kept; {_reason(error)}",
            fix="run the same command again to go on",
        )
    return _unreachable(url, error)


def _unreachable(url: str, error: Exception) -> FetchError:
    return FetchError(
        f"{urlsplit(url).netloc} cannot be reached",
        where=url,
        found=_reason(error),
        fix="check the network and the proxy (HTTPS_PROXY). Without a network: run this command "
        "with -o, --masks-dir or --clip-dir FOLDER on a machine that has one, and bring the folder",
    )


def _reason(error: Exception) -> str:
    """The innermost cause: requests quotes urllib3, which quotes the socket."""
    inner: object = error
    while isinstance(inner, Exception):
        error = inner
        inner = getattr(error, "reason", None) or next(iter(error.args), None)
    return " ".join(str(error).split())
