"""Time retrieval by appearance, such as with a prior of many objects from tools/copy_prior.py.

    python tools/time_appearance.py --prior many/ frame.npz

Printed are milliseconds of processor time to open the prior and for each object of the frame, and
the peak of memory.
"""

from __future__ import annotations

import resource
import sys
import time
from pathlib import Path

import click
import numpy as np

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message

from brrp_cli.config import preset
from brrp_cli.frames.readers import read_frame
from brrp_cli.observation.ray_samples import scene_plane
from brrp_cli.observation.strays import without_strays
from brrp_cli.prior.store import open_prior
from brrp_cli.retrieval.appearance import AppearanceRetriever
from brrp_cli.retrieval.base import top_k
from brrp_cli.retrieval.illuminants import lights, local_lights, log_prior
from brrp_cli.retrieval.observed_appearance import see_object
from brrp_cli.retrieval.score_fusion import believe
from brrp_cli.retrieval.shortlist import Shortlist
from brrp_cli.retrieval.similarity import lit_histograms, similarity


@click.command()
@click.option("--prior", "prior_path", required=True, type=click.Path(path_type=Path))
@click.argument("frame_path", type=click.Path(path_type=Path))
@one_message()
def main(prior_path: Path, frame_path: Path) -> None:
    """Time a lookup of every object of FRAME."""
    frame = read_frame(frame_path)
    start = time.process_time()
    prior = open_prior(prior_path)
    opened = time.process_time() - start
    retriever = AppearanceRetriever(prior, preset("default"), 0)
    started = time.process_time() - start - opened
    looks = prior.appearance
    config = preset("default")
    own = config.retrieval
    gains = lights(own.illuminants)
    shortlist = Shortlist(looks.first, own)
    frame = without_strays(frame, config.strays)
    plane = scene_plane(frame, config.observation, 0)
    # Not the imports that come with the first of them.
    see_object(frame, frame.object_ids[0], plane, own.observed)
    seconds = dict.fromkeys(("see", "light", "look up"), 0.0)
    found = []
    for object_id in frame.object_ids:
        clock = [time.process_time()]
        seen = see_object(frame, object_id, plane, own.observed)
        clock.append(time.process_time())
        histograms = lit_histograms(seen, gains)
        clock.append(time.process_time())
        rows = shortlist.rows(seen, histograms)
        stored = looks.rows(rows)
        found.append(similarity(seen, histograms, stored, rows, len(gains), own.similarity))
        clock.append(time.process_time())
        for stage, spent in zip(seconds, np.diff(clock), strict=True):
            seconds[stage] += float(spent)
    start = time.process_time()
    lit = own.illuminants
    light, local = log_prior(gains, lit), local_lights(gains, lit)
    answers = believe(found, light, local, len(looks), own.likeness)
    for answer in answers:
        top_k(answer, prior.names, preset("default").k)
    seconds["look up"] += time.process_time() - start
    stages = ", ".join(f"{k} {1e3 * v / len(found):.0f} ms" for k, v in seconds.items())
    for stage in ("in all, with alignment, first", "again"):
        start = time.process_time()
        retriever.evidence(frame)
        stages += f", {stage} {1e3 * (time.process_time() - start) / len(found):.0f} ms"
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    click.echo(
        f"{len(looks)} objects: open {1e3 * opened:.0f} ms, descriptors {1e3 * started:.0f} ms; "
        f"{stages} an object; peak memory {peak:.0f} MB"
    )


if __name__ == "__main__":
    main()
