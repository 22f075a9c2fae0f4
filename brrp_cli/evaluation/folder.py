"""The folder of an evaluation: whose run it holds, and what is written into it at the end."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from brrp_cli.errors import OutputError
from brrp_cli.files import check_writable, parse_json, write_bytes
from brrp_cli.prior.parameters import differences

ROWS, PARAMETERS, LOCK = "rows.jsonl", "run.json", ".lock"


@contextmanager
def claimed(folder: Path, parameters: Mapping[str, Any], *, overwrite: bool) -> Iterator[Path]:
    """The path of the rows, of this run alone, while nobody else works in the folder.

    Errors: OutputError if the folder holds a run with other parameters (which are named) or
    something else than a run, and `overwrite` is false; if another run is at work there; or if it
    cannot be written.
    """
    table = json.loads(json.dumps(parameters))
    check_writable(folder)
    lock = FileLock(folder / LOCK)
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise OutputError(
            "Another evaluation is at work in this folder",
            where=folder,
            fix="wait until it ends, or choose another folder with -o",
        ) from None
    try:
        if overwrite:
            (folder / ROWS).unlink(missing_ok=True)
        else:
            _refuse_other(folder, table)
        write_bytes(folder / PARAMETERS, (json.dumps(table, indent=1) + "\n").encode())
        yield folder / ROWS
    finally:
        lock.release()


def _refuse_other(folder: Path, table: Mapping[str, Any]) -> None:
    path = folder / PARAMETERS
    if not path.exists():
        others = sorted(each.name for each in folder.iterdir() if each.name != LOCK)
        if others:
            raise OutputError(
                "The folder holds something else than an evaluation",
                where=folder,
                found=", ".join(others[:5]),
                fix="choose another folder with -o, or pass --overwrite to write into this one",
            )
        return
    try:
        before = dict(parse_json(path.read_bytes()))
    except (OSError, ValueError, TypeError) as error:
        raise OutputError(
            "Cannot tell which run the folder holds",
            where=path,
            found=error,
            fix="pass --overwrite to start anew",
        ) from error
    found = differences(before, table)
    if found:
        raise OutputError(
            "The folder holds an evaluation with other parameters",
            where=folder,
            found="; ".join(found),
            fix="choose another folder with -o, or pass --overwrite to start anew",
        )
