"""Sets of frames, each a row of one table: made ones, those of each sensor, real ones."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from plain.reconstruct import STAGES, reconstruct_plainly

from brrp_cli.config import preset
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.frames.readers import read_frame
from brrp_cli.ground_truth.scenes import find_scenes
from brrp_cli.prior.store import Prior
from brrp_cli.retrieval.choose import choose_retriever
from brrp_cli.session import Reconstructor
from brrp_cli.threads import cores
from speed.measure import run

HEAD = (
    f"  {'set':14}{'frames':>7}{'objects':>9}{'known':>7}{'s/object':>10}{'s/frame':>9}{'most':>7}"
    f"{'masks':>7}{'CPU/object':>12}{'busy':>7}{'plain':>8}{'ratio':>7}"
)


@dataclass(frozen=True)
class SetRow:
    """Medians over the frames of a set, warm; seconds on the wall where nothing else is said.

    objects, known : of all frames, and those that were recognised; an_object, a_frame, most :
    with all workers, masks included where the frames have none; masks : of a frame; cpu_an_object :
    CPU seconds on one thread; busy : times that CPU where the other cores are kept busy; plain : of
    an object by the plain implementation
    """

    name: str
    frames: int
    objects: int
    known: int
    an_object: float
    a_frame: float
    most: float
    masks: float
    cpu_an_object: float
    busy: float
    plain: float | None

    def line(self) -> str:
        """As `HEAD` has it."""
        told = f"{self.plain:8.1f}{self.plain / self.an_object:7.0f}" if self.plain else ""
        return (
            f"  {self.name:14}{self.frames:7}{self.objects:9}{self.known:7}{self.an_object:10.3f}"
            f"{self.a_frame:9.2f}{self.most:7.2f}{self.masks:7.2f}{self.cpu_an_object:12.3f}"
            f"{self.busy:7.2f}{told}"
        )


def frames_of(folder: Path, most: int, *, masks: bool = True) -> list[Frame]:
    """The frames FOLDER/*.npz, or else the first view of each scene in it, `most` at most; without
    `masks` those that they have are dropped.

    Errors: FrameError, SceneError.
    """
    paths = sorted(folder.glob("*.npz"))[:most]
    if paths:
        frames = [read_frame(path) for path in paths]
    else:
        frames = [scene.view(0) for scene in find_scenes(folder)[:most]]
    if masks:
        return frames
    return [replace(frame, segmap=np.full_like(frame.segmap, BACKGROUND)) for frame in frames]


def measure_set(
    name: str, frames: list[Frame], prior: Prior, workers: int, repeats: int, *, plain: bool
) -> SetRow:
    """Every frame `repeats` times after a first one. Errors: BrrpError."""
    alone, many = Reconstructor(prior, workers=1), Reconstructor(prior, workers=workers)
    many(frames[0])
    # A first round for the helpers, which have started by then.
    many.helpers.wait()
    results = [many(frame) for frame in frames]
    counts = [len(result.objects) for result in results]
    threaded = [[run(lambda f=frame: many(f)) for _ in range(repeats)] for frame in frames]
    walls = [float(np.median([each.wall for each in runs])) for runs in threaded]
    masks = [each.result.seconds.get("masks", 0.0) for runs in threaded for each in runs]
    many.close()
    for frame in frames:
        alone(frame)
    quiet = [run(lambda f=frame: alone(f)).cpu for frame in frames]
    with other_cores_busy():
        busy = [run(lambda f=frame: alone(f)).cpu for frame in frames]
    known = sum(
        (item.unknown_weight is not None and item.unknown_weight < 0.5)
        for result in results
        for item in result.reconstructed
    )
    return SetRow(
        name=name,
        frames=len(frames),
        objects=sum(counts),
        known=known,
        an_object=float(np.median(np.array(walls) / counts)),
        a_frame=float(np.median(walls)),
        most=max(walls),
        masks=float(np.median(masks)),
        cpu_an_object=float(np.median(np.array(quiet) / counts)),
        busy=sum(busy) / sum(quiet),
        plain=_plain(results[0].frame, prior) if plain else None,
    )


@contextmanager
def other_cores_busy() -> Iterator[None]:
    """While it lasts, one process for each other core that does nothing but compute."""
    spinning = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(cores() - 1)
    ]
    try:
        yield
    finally:
        for each in spinning:
            each.kill()
            each.wait()


def _plain(frame: Frame, prior: Prior) -> float:
    """Seconds of one object by the plain implementation, on all cores, its share of what a whole
    frame costs included."""
    config = preset("paper")
    retriever = choose_retriever("auto", prior, config, 0)
    observation, spent = reconstruct_plainly(frame, prior, retriever, config, objects=1)
    each = sum(spent[0][stage] for stage in STAGES if stage != "retrieval")
    return each + (observation + spent[0]["retrieval"]) / len(frame.object_ids)
