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
from brrp_cli.config.tracking import SharpenConfig, TrackConfig
from brrp_cli.errors import FrameError
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.geometry import normalise
from brrp_cli.mending.again import Again, Objects
from brrp_cli.mending.mend import mend
from brrp_cli.mending.strangers import of_left_out
from brrp_cli.methods.base import EarlierView, Memory, Stream
from brrp_cli.methods.configuration import MethodConfig
from brrp_cli.methods.registry import DEFAULT, reconstructing_method
from brrp_cli.methods.shared_work import started_later
from brrp_cli.prior.store import Prior, open_prior
from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction
from brrp_cli.retrieval.base import one_image
from brrp_cli.segmentation.mend_masks import changed_masks
from brrp_cli.tracking.carried import with_carried
from brrp_cli.tracking.followed import Followed, first_frame, follow, not_tried, with_known
from brrp_cli.tracking.lost import Lost, lost_tracks
from brrp_cli.tracking.motion import at_rest, camera_motion, spread_out, unmoved

if TYPE_CHECKING:
    from brrp_cli.retrieval.base import Retriever
    from brrp_cli.segmentation.prompted.segment_by_prompt import PromptSegmenter


class Reconstructor:
    """Reconstructs frame after frame with one prior, one retriever and one maker of masks.

    prior : opened, or the path of one; None with a method that has none
    config, weights, seed, device, workers : as in `reconstruct`
    retriever : a name as `brrp reconstruct --retriever` takes it
    prompt : makes masks of what it names where a frame has none; None = of what stands on the
        table; segmentation : the numbers of both
    track : whether frames are those of one stream: an object keeps its id, and one that has not
        moved before a camera that stands keeps its result, and what earlier frames showed of one
        at rest joins what the newest shows; or the numbers of that
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
        retriever: str = "auto",
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
        self._track = TrackConfig() if track is True else track or None
        self._last: Followed | None = None
        # Frames, and what was inferred from each and still holds.
        self._made: list[tuple[Frame, Reconstruction]] = []
        # Of each object, the frames that showed it and what the method remembers of them.
        self._seen: dict[int, list[tuple[Frame, Memory]]] = {}
        self._workers = workers
        self.helpers = started_later(reconstructing_method(method), workers, helpers)
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
        those that brrp made, now or before, are mended by what is recognised.

        Errors: BrrpError; FrameError if nothing stands on the table.
        """
        with one_image(self._retriever):
            result = self._reconstructed(frame)
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
        made = not frame.object_ids or frame.aside is not None
        masked, aside = frame.with_masks(frame.segmap), frame.aside
        if not frame.object_ids:
            masked, aside = self._with_masks(frame)
        seconds = time.perf_counter() - start
        if self._track is not None:
            result = self._tracked(masked, aside, frame.corrected, mends=made)
        else:
            result = self._all(masked)
            if made:
                result = self._mended(result, self._all, aside, corrected=frame.corrected)
        result.seconds["masks"] = seconds
        return replace(result, segmentation=asdict(self._segmentation)) if made else result

    def _tracked(
        self,
        frame: Frame,
        aside: NDArray[np.int64] | None,
        corrected: Collection[int],
        *,
        mends: bool,
    ) -> Reconstruction:
        """All objects under the ids of their tracks; those that have not moved as they were."""
        assert self._track is not None
        start = time.perf_counter()
        carried = np.zeros(frame.shape, np.bool_)
        if self._last is not None and aside is not None:
            frame = with_known(self._last, frame, aside, self._track)
        if self._last is not None and mends:
            frame, carried = with_carried(self._last, frame, self._track, corrected)
        followed = (
            first_frame(frame) if self._last is None else follow(self._last, frame, self._track)
        )
        seen, kept = followed.frame, []
        theirs = np.isin(frame.segmap, [*corrected])
        corrected = np.unique(seen.segmap[theirs]).tolist()
        # Held to the frame that they were inferred from: what creeps is found in the end.
        for made, result in self._made:
            still = unmoved(made, seen, self._track)
            kept += [
                replace(each, seconds={})
                for each in result.reconstructed
                if each.object_id in still
            ]
        seconds = time.perf_counter() - start
        todo = set(seen.object_ids) - {item.object_id for item in kept}
        stream = self._stream(seen, todo)
        infer = partial(self._all, stream=stream)
        if todo or not self._made:
            result = infer(seen, todo)
        else:
            result = replace(self._made[0][1], frame=seen, objects=[], seconds={}, image=None)
        objects = sorted([*result.objects, *kept], key=lambda item: item.object_id)
        result = replace(result, objects=objects)
        if mends:
            fresh = aside
            if self._last is not None and aside is not None:
                fresh = not_tried(self._last, frame, aside, self._track)
            result = self._mended(result, infer, fresh, todo, followed.next_id, corrected)
        result.seconds["tracking"] = seconds
        # Mending may have made anew what was kept.
        was = {item.object_id: item for item in kept}
        new = [item for item in result.objects if was.get(item.object_id) is not item]
        left = self._only(was.keys() - {item.object_id for item in new})
        if stream is not None:
            self._remember(result.frame, new, stream.config)
        # What only other masks of the same image ask for is not kept.
        newest = replace(result, objects=new, image=None)
        self._made = [(result.frame, newest), *left] if new else left
        next_id = max(followed.next_id, max(result.frame.object_ids) + 1)
        mended = set(np.unique(result.frame.segmap[carried]).tolist()) - {BACKGROUND}
        if mends:
            least = self._segmentation.mend.least_part
            mended |= set(changed_masks(result.frame.segmap, seen.segmap, least))
        lost: tuple[Lost, ...] = ()
        if self._last is not None:
            lost = lost_tracks(self._last.frame, self._last.lost, result.frame, self._track)
        self._last = _followed(result.frame, next_id, frozenset(mended), lost, aside)
        return result

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

    def _stream(self, frame: Frame, ids: Collection[int]) -> Stream | None:
        """What earlier frames showed of those objects of this one that are at rest since; all else
        of them is forgotten."""
        track = self._track
        if track is None or track.sharpen is None:
            return None
        here = set(frame.object_ids)
        if self._last is not None:
            # Who is out of sight may come back.
            here |= {*self._last.frame.object_ids, *(each.object_id for each in self._last.lost)}
        self._seen = {i: views for i, views in self._seen.items() if i in here}
        earlier: dict[int, tuple[EarlierView, ...]] = {}
        for object_id in self._seen.keys() & set(ids):
            rest = []
            for then, memory in self._seen[object_id]:
                T = camera_motion(then, frame, track)
                if T is not None and at_rest(then, frame, T, object_id, track.sharpen):
                    rest.append((then, EarlierView(T, memory)))
            self._seen[object_id] = [(then, view.memory) for then, view in rest]
            earlier[object_id] = tuple(view for _, view in rest)
        return Stream(earlier, track.sharpen)

    def _remember(
        self, frame: Frame, new: list[ObjectReconstruction], config: SharpenConfig
    ) -> None:
        """The newest view of what was inferred, and of the earlier ones those from the most
        different sides."""
        assert self._track is not None
        for item in new:
            memory, item.memory = item.memory, None
            if memory is None or item.center is None:
                continue
            views = [] if memory.alone else self._seen.get(item.object_id, [])
            motions = [camera_motion(then, frame, self._track) for then, _ in views]
            toward = [T[:3, 3] - item.center for T in motions if T is not None]
            kept = spread_out(normalise(np.reshape(toward, (-1, 3))), config.views - 1)
            self._seen[item.object_id] = [*(views[i] for i in kept), (frame, memory)]

    def _only(self, ids: Collection[int]) -> list[tuple[Frame, Reconstruction]]:
        """What was made of earlier frames, of the objects `ids`."""
        left = [
            (frame, replace(made, objects=[o for o in made.objects if o.object_id in ids]))
            for frame, made in self._made
        ]
        return [(frame, made) for frame, made in left if made.objects]

    def _all(
        self,
        frame: Frame,
        only: Collection[int] | None = None,
        *,
        image: Any = None,
        stream: Stream | None = None,
    ) -> Reconstruction:
        return reconstruct(frame, only=only, image=image, stream=stream, **self._given)

    def _tried(
        self,
        frame: Frame,
        masks: Sequence[NDArray[np.bool_]],
        trial: TrialConfig,
        *,
        image: Any = None,
    ) -> list[ObjectReconstruction]:
        return try_masks(frame, masks, trial, image=image, **self._given)

    @property
    def _given(self) -> dict[str, Any]:
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


def _followed(
    frame: Frame,
    next_id: int,
    mended: frozenset[int],
    lost: tuple[Lost, ...],
    aside: NDArray[np.int64] | None,
) -> Followed:
    """What to follow into the next frame; aside : (H, W) masks that were left out, 0 = none."""
    if aside is None:
        return Followed(frame, next_id, mended, lost)
    strangers = np.where(frame.segmap == BACKGROUND, aside, BACKGROUND)
    return Followed(
        frame,
        next_id,
        mended,
        lost,
        of_left_out(frame, aside),
        frame.with_masks(strangers) if strangers.any() else None,
    )
