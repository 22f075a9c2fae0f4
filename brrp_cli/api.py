"""From a frame, and a prior where the method has one, to every object's surface, in Python.

from brrp_cli import load_frame, open_prior, reconstruct
result = reconstruct(load_frame("frame.npz"), open_prior("prior/"))
result.objects[0].surface.as_trimesh()
"""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.registration import TrialConfig
from brrp_cli.errors import BrrpError
from brrp_cli.frames.build import require_objects
from brrp_cli.frames.frame import Frame
from brrp_cli.methods.base import Method, Setup, Stream, Trial
from brrp_cli.methods.configuration import MethodConfig
from brrp_cli.methods.posterior_file import open_posterior
from brrp_cli.methods.registry import DEFAULT, reconstructing_method
from brrp_cli.prior.store import Prior
from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction
from brrp_cli.results import read
from brrp_cli.results.read import StoredResult

if TYPE_CHECKING:
    from brrp_cli.executors.helpers import Helpers
    from brrp_cli.retrieval.base import Retriever


def reconstruct(
    frame: Frame,
    prior: Prior | None = None,
    *,
    method: str = DEFAULT,
    config: MethodConfig | None = None,
    retriever: Retriever | str | None = None,
    weights: str | Path | None = None,
    seed: int = 0,
    device: str = "auto",
    workers: int | None = None,
    helpers: Helpers | None = None,
    only: Collection[int] | None = None,
    given: Collection[int] | None = None,
    image: Any = None,
    stream: Stream | None = None,
) -> Reconstruction:
    """Reconstruct every object of a segmented frame.

    method : a name of brrp_cli/methods/registry.py, which also says what it needs of the rest
    config : one of the method's presets, changed or not; without one, its first
    retriever : P(c|R), or the name of one as `--retriever` takes it (retrieval/choose.py); without
        one, CLIP if `BRRP_CLIP_DIR` is set or CLIP was fetched, else appearance
    weights : a file of what the method was trained to
    workers : objects at a time, by default as many as there are cores
    helpers : processes that do some of the objects, once they are ready (sessions start them)
    only : ids of the objects that are asked for, by default all; the others are still seen as
        objects
    given : ids of the masks that somebody gave, by default all; brrp made the others, and what is
        recognised in a small one of these may be a piece of something else
    image : `Reconstruction.image` of the same frame with other masks
    stream : what earlier frames of the same stream showed (sessions pass it)

    An object that cannot be reconstructed gets a status; the others still are. The frame is never
    changed. The same seed gives the same result, whatever the number of workers.

    Errors: FrameError for a frame without masks; BrrpError for an unknown method, or a prior,
    retriever, weights or configuration that it lacks or cannot use; PriorError for a shard that is
    damaged, when an object is read from it.
    """
    start = time.perf_counter()
    if only is None:
        require_objects(frame)
    chosen = reconstructing_method(method)
    setup = _setup(
        chosen,
        prior,
        config,
        retriever,
        weights,
        seed=seed,
        device=device,
        workers=workers,
        helpers=helpers,
    )
    asked = None if only is None else frozenset(only)
    by_others = None if given is None else frozenset(given)
    setup = replace(setup, only=asked, given=by_others, image=image, stream=stream)
    seconds = {"retriever": time.perf_counter() - start} if chosen.uses_retriever else {}
    result = chosen.run(frame, setup)
    objects = [each for each in result.objects if only is None or each.object_id in only]
    return replace(result, objects=objects, seconds={**seconds, **result.seconds})


def try_masks(
    frame: Frame,
    masks: Sequence[NDArray[np.bool_]],
    trial: TrialConfig,
    prior: Prior | None = None,
    *,
    method: str = DEFAULT,
    config: MethodConfig | None = None,
    retriever: Retriever | str | None = None,
    weights: str | Path | None = None,
    seed: int = 0,
    device: str = "auto",
    workers: int | None = None,
    helpers: Helpers | None = None,
    image: Any = None,
) -> list[ObjectReconstruction]:
    """Which stored objects lie in each of other masks (H, W) of a frame, each in the place of the
    frame's own masks there: what it is taken for, without a shape.

    The rest is as in `reconstruct`. Errors: BrrpError, also for a method that weighs no placements.
    """
    chosen = reconstructing_method(method)
    if chosen.try_masks is None:
        raise BrrpError(f"{method} weighs no placements, and cannot try masks")
    setup = _setup(
        chosen,
        prior,
        config,
        retriever,
        weights,
        seed=seed,
        device=device,
        workers=workers,
        helpers=helpers,
    )
    return chosen.try_masks(
        frame, replace(setup, given=frozenset(), image=image), Trial(masks, trial)
    )


def _setup(
    chosen: Method,
    prior: Prior | None,
    config: MethodConfig | None,
    retriever: Retriever | str | None,
    weights: str | Path | None,
    *,
    seed: int,
    device: str,
    workers: int | None,
    helpers: Helpers | None,
) -> Setup:
    """What a method is given, checked. Errors: BrrpError."""
    if isinstance(retriever, str) and not chosen.uses_retriever:
        raise chosen.takes_no_retriever()
    setup = Setup(
        config=config if config is not None else chosen.preset(),
        seed=seed,
        device=device,
        prior=prior,
        retriever=None if isinstance(retriever, str) else retriever,
        weights=None if weights is None else Path(weights),
        workers=workers,
        helpers=helpers,
    )
    chosen.check(setup)
    if chosen.uses_retriever and setup.retriever is None and prior is not None:
        from brrp_cli.retrieval.choose import choose_retriever

        name = retriever if isinstance(retriever, str) else "auto"
        setup = replace(setup, retriever=choose_retriever(name, prior, setup.config, seed))
    return setup


def open_result(folder: str | Path) -> StoredResult:
    """The results in a folder that `brrp reconstruct` wrote, or in one of `brrp demo`.

    Errors: ResultError if there are none, or if they are of another schema.
    """
    return read.open_result(folder, open_posterior)
