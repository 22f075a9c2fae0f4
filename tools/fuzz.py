"""Throw bytes at the readers of frames, manifests, tables and results, guided by which code they
reach.

A reader may give a result or one of the project's own errors; whatever else comes out of it, or
takes longer than two seconds, is kept in the folder of findings: the input, and the traceback.
The first byte of an input chooses the reader. Needs `pip install '.[fuzz,ros]'`.

    nice python tools/fuzz.py --minutes 30 -o findings/

Ends with 1 if there are findings. `--replay FILE...` runs kept inputs again.
"""

from __future__ import annotations

import argparse
import hashlib
import logging
import multiprocessing
import sys
import time
import traceback
from contextlib import nullcontext
from pathlib import Path

import atheris

# The worker that builds the small prior needs none of it, and imports this file too.
with (
    nullcontext()
    if multiprocessing.parent_process()
    else atheris.instrument_imports(
        include=[
            "brrp_cli",
            "zipfile",
            "json",
            "numpy.lib",
            "numpy.lib._format_impl",
            "csv",
            "tomllib",
        ]
    )
):
    from fuzzing.inputs import first_inputs
    from fuzzing.readers import READERS

    from brrp_cli.errors import BrrpError

SLOW = 2.0
MAX_BYTES = 20_000


def one(data: bytes, findings: Path) -> None:
    """One input; what nobody foresaw is kept."""
    if not data:
        return
    reader = READERS[data[0] % len(READERS)]
    start = time.process_time()
    told = ""
    try:
        reader(data[1:])
    except BrrpError as error:
        str(error)
    except Exception:
        told = traceback.format_exc()
    if time.process_time() - start > SLOW:
        told += f"{reader.__name__} took {time.process_time() - start:.1f} s of processor time\n"
    if not told:
        return
    # One of a kind: where it came up, and what it is.
    lines = [line for line in told.splitlines() if line.startswith("  File") or line[:1].isalpha()]
    kind = hashlib.sha256("\n".join([*lines[-4:-1], lines[-1].split(":")[0]]).encode()).hexdigest()
    path = findings / f"{reader.__name__}-{kind[:12]}"
    if not path.exists():
        path.write_bytes(data)
        path.with_suffix(".txt").write_text(told)
        print(f"found: {path}: {lines[-1][:200]}", flush=True)


def main() -> None:
    """Fuzz, or run kept inputs again."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--minutes", type=float, default=30)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("-o", "--findings", type=Path, default=Path("findings"))
    parser.add_argument("--replay", type=Path, nargs="+")
    options = parser.parse_args()
    logging.disable(logging.CRITICAL)
    options.findings.mkdir(parents=True, exist_ok=True)
    first = first_inputs()
    if options.replay:
        for path in options.replay:
            one(path.read_bytes(), options.findings)
        return
    corpus = options.findings / "corpus"
    corpus.mkdir(exist_ok=True)
    for number, reader in enumerate(READERS):
        for i, data in enumerate(first[reader.__name__]):
            (corpus / f"{reader.__name__}-{i}").write_bytes(bytes([number]) + data)
    arguments = [
        sys.argv[0],
        f"-max_total_time={round(60 * options.minutes)}",
        f"-max_len={MAX_BYTES}",
        f"-seed={options.seed}",
        "-rss_limit_mb=3000",
        "-timeout=30",
        f"-artifact_prefix={options.findings}/",
        "-print_final_stats=1",
        str(corpus),
    ]
    atheris.Setup(arguments, lambda data: one(data, options.findings))
    atheris.Fuzz()


if __name__ == "__main__":
    main()
