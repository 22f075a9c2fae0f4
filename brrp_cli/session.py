"""A stream of frames in one process: what takes long to load is loaded once.

from brrp_cli import Reconstructor
again = Reconstructor("prior/", prompt="small object")
for frame in camera:
    result = again(frame)
"""

from __future__ import annotations

import time
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from brrp_cli.api import reconstruct, try_masks
from brrp_cli.config.registration import TrialConfig
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.config.tracking import TrackConfig
from brrp_cli.errors import FrameError
from brrp_cli.frames.build import require_frame
from brrp_cli.frames.frame import Frame
from brrp_cli.mending.again import Again, Objects
from brrp_cli.mending.mend import mend
from brrp_cli.methods.base import Stream
from brrp_cli.methods.configuration import MethodConfig
from brrp_cli.methods.registry import DEFAULT, reconstructing_method
from brrp_cli.methods.shared_work import started_later
from brrp_cli.prior.store import Prior, open_prior
from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction
from brrp_cli.registration.exchanged_colours import ColourCheck
from brrp_cli.retrieval.base import one_image
from brrp_cli.tracking.tracker import Made, Tracker

if TYPE_CHECKING:
    from brrp_cli.retrieval.base import Retriever
    from brrp_cli.segmentation.prompted.segment_by_prompt import PromptSegmenter


class Reconstructor:
    """Reconstructs frame after frame with one prior, one retriever and one maker of masks.

    prior : opened, or the path of one; None with a method that has none
    config, weights, seed, device, workers : as in `reconstruct`
    retriever : a name as `brrp reconstruct --retriever` takes it, or one that was opened
    prompt : makes masks of what it names where a frame has none; None = of what stands on the
        table; segmentation : the numbers of both
    track : whether frames are those of one stream: an object keeps its id, and one that has not
        moved its result, before a camera that stands or moves a little, and what earlier frames
        showed of one at rest joins what the newest shows; or the numbers of that
    helpers : processes beside this one that do some of the objects from the second frame on; None =
        one less than there are workers, 3 at most. Results do not depend on them

    Without `track` the same frame and seed give the same result as a process of its own.
    Errors: BrrpError.
    """

    def __init__(
        self,
        prior: Prior | str | Path | None = None,
        *,
        method: str = DEFAULT,
        config: MethodConfig | None = None,
        weights: str | Path | None = None,
        retriever: str | Retriever | None = "auto",
        clip_dir: Path | None = None,
        prompt: str | None = None,
        masks_dir: Path | None = None,
        segmentation: SegmentConfig | None = None,
        seed: int = 0,
        device: str = "auto",
        workers: int | None = None,
        track: bool | TrackConfig = False,
        helpers: int | None = None,
    ) -> None:
        config_of_tracks = TrackConfig() if track is True else track or None
        self._workers = workers
        self.helpers = started_later(reconstructing_method(method), workers, helpers)
        self._method, self._seed, self._device, self._prompt = method, seed, device, prompt
        self._weights = weights
        chosen = reconstructing_method(method)
        self._config = cast(Any, config if config is not None else chosen.preset())
        self._prior = open_prior(Path(prior)) if isinstance(prior, (str, Path)) else prior
        self._retriever: Retriever | None = None
        if self._prior is not None and chosen.uses_retriever:
            if retriever is None or isinstance(retriever, str):
                from brrp_cli.retrieval.choose import choose_retriever

                retriever = choose_retriever(
                    retriever or "auto", self._prior, self._config, seed, clip_dir=clip_dir
                )
            self._retriever = retriever
        self._segmentation = segmentation or SegmentConfig()
        self._tracker: Tracker | None = None
        if config_of_tracks is not None:
            self._tracker = Tracker(config_of_tracks, self._segmentation.mend.least_part)
        self._ask_colours = ColourCheck(self._prior)
        self._segmenter: PromptSegmenter | None = None
        if prompt is not None:
            from brrp_cli.segmentation.prompted.segment_by_prompt import PromptSegmenter

            self._segmenter = PromptSegmenter(masks_dir, self._segmentation)

    def __call__(self, frame: Frame) -> Reconstruction:
        """All objects of one frame; masks are made where it has none, which `seconds` tells, and
        those that brrp made, now or before, are mended by what is recognised.

        Errors: BrrpError; FrameError if nothing stands on the table, or for what is no frame.
        """
        require_frame(frame)
        with one_image(self._retriever):
            result = self._reconstructed(frame)
        self._ask_colours(result)
        # Who asks for one frame only has no use for them.
        self.helpers.start()
        return result

    def close(self) -> None:
        """End the processes beside this one; with the session they end, too."""
        self.helpers.close()

    def __enter__(self) -> Reconstructor:
        return self

    def __exit__(self, *why: object) -> None:
        self.close()

    def _reconstructed(self, frame: Frame) -> Reconstruction:
        start = time.perf_counter()
        if self._tracker is not None:
            frame = self._tracker.posed(frame)
        found = time.perf_counter() - start
        made = not frame.object_ids or frame.aside is not None
        masked, aside = frame.with_masks(frame.segmap), frame.aside
        if not frame.object_ids:
            if self._tracker is not None:
                same = self._tracker.again(masked, self._all)
                if same is not None:
                    same.seconds["masks"] = 0.0
                    same.seconds["tracking"] += found
                    return replace(same, segmentation=asdict(self._segmentation))
            masked, aside = self._with_masks(frame)
        seconds = time.perf_counter() - start - found
        if self._tracker is not None:
            theirs = Made(aside, frame.corrected) if made else None
            result = self._tracker(masked, theirs, self._all, self._mended)
            result.seconds["tracking"] += found
        else:
            infer = partial(self._all, given=frame.corrected if made else None)
            result = infer(masked)
            if made:
                result = self._mended(result, infer, aside, corrected=frame.corrected)
        result.seconds["masks"] = seconds
        return replace(result, segmentation=asdict(self._segmentation)) if made else result

    def _mended(
        self,
        result: Reconstruction,
        infer: Objects,
        aside: NDArray[np.int64] | None,
        asked: Collection[int] | None = None,
        first_free: int = 1,
        corrected: Collection[int] = (),
    ) -> Reconstruction:
        again, config = Again(infer, self._tried), self._segmentation
        return mend(result, self._prior, again, config, aside, asked, first_free, corrected)

    def _all(
        self,
        frame: Frame,
        only: Collection[int] | None = None,
        *,
        given: Collection[int] | None = None,
        image: Any = None,
        stream: Stream | None = None,
    ) -> Reconstruction:
        return reconstruct(frame, only=only, given=given, image=image, stream=stream, **self._setup)

    def _tried(
        self,
        frame: Frame,
        masks: Sequence[NDArray[np.bool_]],
        trial: TrialConfig,
        *,
        image: Any = None,
    ) -> list[ObjectReconstruction]:
        return try_masks(frame, masks, trial, image=image, **self._setup)

    @property
    def _setup(self) -> dict[str, Any]:
        return {
            "prior": self._prior,
            "method": self._method,
            "config": self._config,
            "retriever": self._retriever,
            "weights": self._weights,
            "seed": self._seed,
            "device": self._device,
            "workers": self._workers,
            "helpers": self.helpers,
        }

    def stream(self, frames: Iterable[Frame]) -> Iterator[Reconstruction | FrameError]:
        """One answer for each frame: a frame that cannot be used gives its error and ends
        nothing."""
        for frame in frames:
            try:
                yield self(frame)
            except FrameError as error:
                yield error

    def _with_masks(self, frame: Frame) -> tuple[Frame, NDArray[np.int64] | None]:
        """The frame with masks, and masks (H, W) that were left out."""
        from brrp_cli.segmentation.segment import segment_and_aside

        if self._segmenter is not None and self._prompt is not None:
            return frame.with_masks(self._segmenter(frame, self._prompt, self._seed)), None
        segmap, aside = segment_and_aside(frame, self._seed, self._segmentation)
        return frame.with_masks(segmap), aside
