"""A stream of frames in one process: what takes long to load is loaded once.

from brrp_cli import Reconstructor
again = Reconstructor("prior/", prompt="small object")
for frame in camera:
    result = again(frame)
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from brrp_cli.api import reconstruct
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.errors import FrameError
from brrp_cli.frames.frame import Frame
from brrp_cli.mending import mend
from brrp_cli.methods.configuration import MethodConfig
from brrp_cli.methods.registry import DEFAULT, reconstructing_method
from brrp_cli.prior.store import Prior, open_prior
from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction

if TYPE_CHECKING:
    from brrp_cli.retrieval.base import Retriever
    from brrp_cli.segmentation.prompted.segment_by_prompt import PromptSegmenter


class Reconstructor:
    """Reconstructs frame after frame with one prior, one retriever and one maker of masks.

    prior : opened, or the path of one; None with a method that has none
    config, weights, seed, device, workers : as in `reconstruct`
    retriever : a name as `brrp reconstruct --retriever` takes it
    prompt : makes masks of what it names where a frame has none; None = of what stands on the
        table, without a model; segmentation : the numbers of both

    The same frame and seed give the same result as a process of its own. Errors: BrrpError.
    """

    def __init__(
        self,
        prior: Prior | str | Path | None = None,
        *,
        method: str = DEFAULT,
        config: MethodConfig | None = None,
        weights: str | Path | None = None,
        retriever: str = "auto",
        clip_dir: Path | None = None,
        prompt: str | None = None,
        masks_dir: Path | None = None,
        segmentation: SegmentConfig | None = None,
        seed: int = 0,
        device: str = "auto",
        workers: int | None = None,
    ) -> None:
        self._workers = workers
        self._method, self._seed, self._device, self._prompt = method, seed, device, prompt
        self._weights = weights
        chosen = reconstructing_method(method)
        self._config = cast(Any, config if config is not None else chosen.preset())
        self._prior = open_prior(Path(prior)) if isinstance(prior, (str, Path)) else prior
        self._retriever: Retriever | None = None
        if self._prior is not None and chosen.uses_retriever:
            from brrp_cli.retrieval.choose import choose_retriever

            self._retriever = choose_retriever(
                retriever, self._prior, self._config, seed, clip_dir=clip_dir
            )
        self._segmentation = segmentation or SegmentConfig()
        self._segmenter: PromptSegmenter | None = None
        if prompt is not None:
            from brrp_cli.segmentation.prompted.segment_by_prompt import PromptSegmenter

            self._segmenter = PromptSegmenter(masks_dir, self._segmentation)

    def __call__(self, frame: Frame) -> Reconstruction:
        """All objects of one frame; masks are made where it has none, which `seconds` tells, and
        mended by what is recognised.

        Errors: BrrpError; FrameError if nothing stands on the table.
        """
        start = time.perf_counter()
        masked = frame if frame.object_ids else self._with_masks(frame)
        seconds = time.perf_counter() - start
        result = self._reconstruct(masked)
        result.seconds["masks"] = seconds
        if masked is frame:
            return result
        result = mend(result, self._prior, self._reconstruct, self._segmentation.mend)
        return replace(result, segmentation=asdict(self._segmentation))

    def _reconstruct(
        self, frame: Frame, kept: Sequence[ObjectReconstruction] = ()
    ) -> Reconstruction:
        return reconstruct(
            frame,
            self._prior,
            method=self._method,
            config=self._config,
            retriever=self._retriever,
            weights=self._weights,
            seed=self._seed,
            device=self._device,
            workers=self._workers,
            kept=kept,
        )

    def stream(self, frames: Iterable[Frame]) -> Iterator[Reconstruction | FrameError]:
        """One answer for each frame: a frame that cannot be used gives its error and ends
        nothing."""
        for frame in frames:
            try:
                yield self(frame)
            except FrameError as error:
                yield error

    def _with_masks(self, frame: Frame) -> Frame:
        from brrp_cli.segmentation.segment import segment

        if self._segmenter is not None and self._prompt is not None:
            return replace(frame, segmap=self._segmenter(frame, self._prompt, self._seed))
        return replace(frame, segmap=segment(frame, self._seed, self._segmentation))
