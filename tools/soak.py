"""Reconstruct frame after frame in one process, and tell whether its memory stays flat.

    python tools/soak.py frame.npz other.npz --prior prior/ --frames 500
    python tools/soak.py frame.npz other.npz --prior prior/ --helpers 1

The frames are taken in turn, each with another seed, and read from their files each time. With
--helpers they are those of one session, with one seed, and what its helper processes hold for
themselves counts, too. After every tenth the memory that is held is told. Ends with 1 if the last
quarter holds more than the second by over 5 % or 20 MB, whichever is more: what is loaded once is
loaded by then.
"""

from __future__ import annotations

import gc
import os
import sys
import time
from itertools import cycle, islice
from pathlib import Path

import click
import numpy as np

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message
from speed.measure import own_megabytes

SHARE, MEGABYTES = 0.05, 20.0


def held() -> float:
    """Megabytes of this process in memory."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGESIZE") / 1e6


def grown(samples: list[float]) -> tuple[float, float]:
    """Medians of the second and of the last quarter of samples (n,), n >= 4."""
    quarters = np.array_split(np.asarray(samples), 4)
    return float(np.median(quarters[1])), float(np.median(quarters[3]))


def is_flat(samples: list[float]) -> bool:
    """Whether memory stays where it was once everything had been loaded."""
    before, after = grown(samples)
    return after - before <= max(SHARE * before, MEGABYTES)


@click.command()
@click.argument("frames", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--prior", type=click.Path(path_type=Path), help="Without one: V-PRISM.")
@click.option("--preset", default="default", show_default=True)
@click.option("--frames", "count", default=500, show_default=True, type=click.IntRange(4))
@click.option("--helpers", default=0, show_default=True, type=click.IntRange(0))
@one_message()
def main(
    frames: tuple[Path, ...], prior: Path | None, preset: str, count: int, helpers: int
) -> None:
    """See above."""
    from brrp_cli import Reconstructor, load_frame, open_prior, reconstruct
    from brrp_cli.config import preset as chosen

    opened = None if prior is None else open_prior(prior)
    if helpers and opened is None:
        raise click.UsageError("--helpers goes with --prior")
    session = None
    if helpers:
        session = Reconstructor(opened, config=chosen(preset), workers=helpers + 1, helpers=helpers)
    samples, statuses = [], set()
    start = time.perf_counter()
    for number, path in enumerate(islice(cycle(frames), count)):
        if session is not None:
            result = session(load_frame(path))
        else:
            result = reconstruct(
                load_frame(path),
                opened,
                method="vprism" if opened is None else "brrp",
                config=None if opened is None else chosen(preset),
                seed=number,
            )
        statuses |= {item.status for item in result.objects}
        del result
        gc.collect()
        others = [] if session is None else session.helpers.processes
        samples.append(held() + sum(map(own_megabytes, others)))
        if number % 10 == 9:
            click.echo(
                f"{number + 1:5d}  {samples[-1]:7.1f} MB  {time.perf_counter() - start:7.0f} s"
            )
    before, after = grown(samples)
    click.echo(
        f"{count} frames in one process, {', '.join(sorted(statuses))}: {before:.1f} MB in the "
        f"second quarter, {after:.1f} MB in the last; at most {max(samples):.1f} MB"
    )
    sys.exit(0 if is_flat(samples) else 1)


if __name__ == "__main__":
    main()
