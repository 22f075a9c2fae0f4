"""Time retrieval by appearance with a prior of many made-up objects.

    python tools/time_appearance.py --prior prior/ --objects 50000 frame.npz

The descriptors of `prior` are mixed in pairs and stretched, so that no two are alike; no meshes and
no shards are made. Printed are milliseconds of processor time for each object of the frame, and
memory.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from brrp_cli.config import preset
from brrp_cli.errors import BrrpError, PriorError
from brrp_cli.frames.readers import read_frame
from brrp_cli.prior.store import open_prior
from brrp_cli.retrieval.appearance import AppearanceRetriever
from brrp_cli.retrieval.belief import believe
from brrp_cli.retrieval.lights import lights, local_lights, log_prior
from brrp_cli.retrieval.likeness import evidence, lit_histograms
from brrp_cli.retrieval.seen import see_object
from brrp_cli.retrieval.shortlist import Shortlist

CHUNK = 1_000


@click.command()
@click.option("--prior", "prior_path", required=True, type=click.Path(path_type=Path))
@click.option("--objects", default=50_000, show_default=True, type=click.IntRange(CHUNK))
@click.argument("frame_path", type=click.Path(path_type=Path))
def main(prior_path: Path, objects: int, frame_path: Path) -> None:
    """Time a lookup of every object of FRAME."""
    try:
        prior, frame = open_prior(prior_path), read_frame(frame_path)
        if prior.appearance is None:
            raise PriorError("The prior has no descriptors", where=prior_path)
        retriever = AppearanceRetriever(prior, preset("default"), 0)
    except BrrpError as error:
        raise click.ClickException(str(error)) from error
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.npy"
        write_table(path, np.asarray(prior.appearance), objects)
        table = np.load(path, mmap_mode="r")
        gains = lights()
        shortlist = Shortlist(table)
        plane = retriever.plane(frame)
        seconds = dict.fromkeys(("see", "light", "look up"), 0.0)
        found = []
        for object_id in frame.object_ids:
            clock = [time.process_time()]
            seen = see_object(frame, object_id, plane)
            clock.append(time.process_time())
            histograms = lit_histograms(seen, gains)
            clock.append(time.process_time())
            rows = shortlist.rows(seen, histograms)
            found.append(evidence(seen, histograms, table, rows, len(gains)))
            clock.append(time.process_time())
            for stage, spent in zip(seconds, np.diff(clock), strict=True):
                seconds[stage] += float(spent)
        start = time.process_time()
        believe(found, log_prior(gains), local_lights(gains), objects)
        seconds["look up"] += time.process_time() - start
        stages = ", ".join(f"{k} {1e3 * v / len(found):.0f} ms" for k, v in seconds.items())
        size = path.stat().st_size / 1e6
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    click.echo(f"{objects} objects, {size:.0f} MB: {stages} an object; peak memory {peak:.0f} MB")


def write_table(path: Path, source: NDArray[Any], count: int) -> None:
    """`count` rows, each mixed of two of `source`."""
    rng = np.random.default_rng(0)
    table = np.lib.format.open_memmap(path, mode="w+", dtype=source.dtype, shape=(count,))
    for start in range(0, count, CHUNK):
        rows = table[start : start + CHUNK]
        one, two = (source[rng.integers(len(source), size=len(rows))] for _ in range(2))
        share = rng.random((len(rows), 1, 1))
        for field in ("colour", "pairs"):
            mixed = (
                share * one[field].astype(float) ** 2 + (1 - share) * two[field].astype(float) ** 2
            )
            rows[field] = np.rint(np.sqrt(mixed))
        rows["sizes"] = one["sizes"] * rng.uniform(0.5, 1.5, (len(rows), 1, 3))
    table.flush()


if __name__ == "__main__":
    main()
