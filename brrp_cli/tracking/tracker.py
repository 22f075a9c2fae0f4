"""A stream's objects: who is who, what is inferred again, and what earlier frames tell of it."""

from __future__ import annotations

import time
from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.tracking import SharpenConfig, TrackConfig
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.geometry import normalise
from brrp_cli.mending.again import Objects
from brrp_cli.mending.strangers import of_left_out
from brrp_cli.methods.base import EarlierView, Memory, Stream
from brrp_cli.observation.support_plane import Plane
from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction
from brrp_cli.segmentation.mend_masks import changed_masks
from brrp_cli.tracking.carried import with_carried
from brrp_cli.tracking.followed import Followed, first_frame, follow, not_tried, with_known
from brrp_cli.tracking.glided import glided
from brrp_cli.tracking.lost import Lost, lost_tracks
from brrp_cli.tracking.motion import at_rest, camera_motion, camera_stands, spread_out, unmoved
from brrp_cli.tracking.moved import holds, moved_object
from brrp_cli.tracking.odometry import Odometry
from brrp_cli.tracking.renamed import new_names, with_names
from brrp_cli.tracking.tried import tried_before
from brrp_cli.tracking.unchanged import unchanged


@dataclass(frozen=True)
class Made:
    """Masks that brrp made. aside : (H, W) masks that were left out, 0 = none, None = not known;
    corrected : ids of those that somebody corrected since"""

    aside: NDArray[np.int64] | None
    corrected: frozenset[int]


class Infer(Protocol):
    """Reconstructs objects of a frame; only : their ids; given : of masks that somebody gave, None
    = all."""

    def __call__(
        self,
        frame: Frame,
        only: Collection[int] | None = None,
        *,
        given: Collection[int] | None = None,
        stream: Stream | None = None,
    ) -> Reconstruction:
        """See above."""


class Mend(Protocol):
    """Mends masks; the arguments are those of `mend`."""

    def __call__(
        self,
        result: Reconstruction,
        infer: Objects,
        aside: NDArray[np.int64] | None,
        asked: Collection[int] | None = None,
        first_free: int = 1,
        corrected: Collection[int] = (),
    ) -> Reconstruction:
        """See above."""


class Tracker:
    """Frame after frame of one stream.

    config : its numbers; least_part : of a mask that differs, for it to count as another
    """

    def __init__(self, config: TrackConfig, least_part: float) -> None:
        self._config, self._least_part = config, least_part
        self._odometry = Odometry(config)
        self._last: Followed | None = None
        # The frame that masks were made of last, with these, and its support plane.
        self._masked: tuple[Frame, Plane | None] | None = None
        # Frames, and what was inferred from each and still holds.
        self._made: list[tuple[Frame, Reconstruction]] = []
        # Of each object, the frame in whose mask of it others were looked for.
        self._tried: dict[int, Frame] = {}
        # Of each object, the frames that showed it and what the method remembers of them.
        self._seen: dict[int, list[tuple[Frame, Memory]]] = {}

    def __call__(
        self, frame: Frame, made: Made | None, everything: Infer, mend: Mend
    ) -> Reconstruction:
        """All objects under the ids of their tracks; those that have not moved as they were.

        made : None for masks that came with the frame, which are not mended
        """
        start = time.perf_counter()
        followed, carried, fresh = self._follow(frame, made)
        seen, kept = followed.frame, self._kept(followed.frame)
        seconds = time.perf_counter() - start
        todo = set(seen.object_ids) - {item.object_id for item in kept}
        stream = self._stream(seen, todo)
        corrected: list[int] | None = None
        if made is not None:
            corrected = np.unique(seen.segmap[np.isin(frame.segmap, [*made.corrected])]).tolist()
        infer = partial(everything, stream=stream, given=corrected)
        result = self._inferred(seen, kept, todo, infer)
        if corrected is not None:
            asked = todo - tried_before(self._tried, seen, self._config)
            result = mend(result, infer, fresh, asked, followed.next_id, corrected)
            result = self._renamed(result, followed, corrected)
            looked = {*result.frame.object_ids} - ({*seen.object_ids} - asked)
            old = {i: f for i, f in self._tried.items() if i in result.frame.object_ids}
            self._tried = old | dict.fromkeys(looked, result.frame)
        result.seconds["tracking"] = seconds
        self._keep(result, kept, stream)
        mended = set(np.unique(result.frame.segmap[carried]).tolist()) - {BACKGROUND}
        if made is not None:
            mended |= set(changed_masks(result.frame.segmap, seen.segmap, self._least_part))
        next_id = max(followed.next_id, max(result.frame.object_ids) + 1)
        aside = None if made is None else made.aside
        self._masked = None if made is None else (result.frame, result.plane)
        self._last = self._followed(result.frame, next_id, frozenset(mended), aside)
        return result

    def posed(self, frame: Frame) -> Frame:
        """The frame with its place in the stream: to be asked for first."""
        return self._odometry(frame, None if self._last is None else self._last.frame)

    def again(self, frame: Frame, everything: Infer) -> Reconstruction | None:
        """All objects of a frame without masks, under those that were made last, where these hold;
        else None."""
        start, last = time.perf_counter(), self._last
        seen = self._masked_as_before(frame)
        if last is None or seen is None:
            return None
        kept = self._kept(seen)
        seconds = time.perf_counter() - start
        todo = set(seen.object_ids) - {item.object_id for item in kept}
        stream = self._stream(seen, todo)
        infer = partial(everything, stream=stream, given=())
        result = self._inferred(seen, kept, todo, infer)
        result.seconds["tracking"] = seconds
        self._keep(result, kept, stream)
        lost = lost_tracks(last.frame, last.lost, seen, self._config)
        self._last = replace(last, frame=seen, lost=lost)
        return result

    def _masked_as_before(self, frame: Frame) -> Frame | None:
        """The frame with the masks that were made last; None where they do not hold."""
        if self._masked is None or frame.shape != self._masked[0].shape:
            return None
        masked, plane = self._masked
        if unchanged(masked, frame, self._config):
            return frame.with_masks(masked.segmap)
        return glided(masked, frame, plane, self._config)

    def _inferred(
        self, seen: Frame, kept: list[ObjectReconstruction], todo: Collection[int], infer: Objects
    ) -> Reconstruction:
        """What was kept, and the objects `todo` as they are inferred now."""
        T = camera_motion(self._made[0][0], seen, self._config) if self._made else None
        if todo or T is None:
            result = infer(seen, only=todo)
        else:
            made = self._made[0][1]
            plane = made.plane
            if plane is not None and not camera_stands(T, self._config):
                plane = plane.moved(T)
            result = replace(made, frame=seen, objects=[], plane=plane, seconds={}, image=None)
        objects = sorted([*result.objects, *kept], key=lambda item: item.object_id)
        return replace(result, objects=objects)

    def _follow(
        self, frame: Frame, made: Made | None
    ) -> tuple[Followed, NDArray[np.bool_], NDArray[np.int64] | None]:
        """The frame under the ids of its tracks, where (H, W) masks are that were mended before,
        and the masks (H, W) that were left out and are to be tried."""
        last, config = self._last, self._config
        fresh = None if made is None else made.aside
        carried = np.zeros(frame.shape, np.bool_)
        if last is None:
            return first_frame(frame), carried, fresh
        masked = frame
        if made is not None:
            if made.aside is not None:
                masked = with_known(last, masked, made.aside, config)
            masked, carried = with_carried(last, masked, config, made.corrected)
            if made.aside is not None:
                fresh = not_tried(last, masked, made.aside, config)
        return follow(last, masked, config), carried, fresh

    def _kept(self, seen: Frame) -> list[ObjectReconstruction]:
        """What was made of objects that have not moved since."""
        kept = []
        # Held to the frame that they were inferred from: what creeps is found in the end.
        for before, result in self._made:
            T = camera_motion(before, seen, self._config)
            if T is None:
                continue
            if camera_stands(T, self._config):
                still = unmoved(before, seen, self._config)
                same = [each for each in result.reconstructed if each.object_id in still]
            else:
                same = self._carried_along(before, result, seen, T)
            kept += [replace(each, seconds={}) for each in same]
        return kept

    def _carried_along(
        self, before: Frame, result: Reconstruction, seen: Frame, T: NDArray[np.float64]
    ) -> list[ObjectReconstruction]:
        """What was made of objects at rest that a camera that has moved by T (4, 4) sees from about
        the same side, in its frame."""
        here = set(seen.object_ids)
        moved = [
            moved_object(each, T)
            for each in result.reconstructed
            if each.object_id in here and holds(before, seen, T, each.object_id, self._config)
        ]
        return [each for each in moved if each is not None]

    def _renamed(
        self, result: Reconstruction, followed: Followed, corrected: Collection[int]
    ) -> Reconstruction:
        """Under the ids of their tracks where mending brought others to light."""
        changed = changed_masks(result.frame.segmap, followed.frame.segmap, self._least_part)
        mended = set(changed) - {*corrected}
        if self._last is None or not mended:
            return result
        names = new_names(self._last, result.frame, mended, followed.next_id, self._config)
        objects = [
            replace(item, object_id=names[item.object_id]) if item.object_id in names else item
            for item in result.objects
        ]
        objects.sort(key=lambda item: item.object_id)
        return replace(result, frame=with_names(result.frame, names), objects=objects)

    def _keep(
        self, result: Reconstruction, kept: list[ObjectReconstruction], stream: Stream | None
    ) -> None:
        """What this frame brought, and what earlier ones did and still holds."""
        # Mending may have made anew what was kept.
        was = {item.object_id: item for item in kept}
        new = [item for item in result.objects if was.get(item.object_id) is not item]
        left = self._only(was.keys() - {item.object_id for item in new})
        if stream is not None:
            self._remember(result.frame, new, stream.config)
        # What only other masks of the same image ask for is not kept.
        newest = replace(result, objects=new, image=None)
        self._made = [(result.frame, newest), *left] if new else left

    def _stream(self, frame: Frame, ids: Collection[int]) -> Stream | None:
        """What earlier frames showed of those objects of this one that are at rest since; all else
        of them is forgotten."""
        track = self._config
        if track.sharpen is None:
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
        for item in new:
            memory, item.memory = item.memory, None
            if memory is None or item.center is None:
                continue
            earlier = [] if memory.alone else self._seen.get(item.object_id, [])
            motions = [camera_motion(then, frame, self._config) for then, _ in earlier]
            # Of a view whose camera is not known to this one, nobody knows the side.
            known = [(each, T) for each, T in zip(earlier, motions, strict=True) if T is not None]
            toward = [T[:3, 3] - item.center for _, T in known]
            kept = spread_out(normalise(np.reshape(toward, (-1, 3))), config.views - 1)
            self._seen[item.object_id] = [*(known[i][0] for i in kept), (frame, memory)]

    def _only(self, ids: Collection[int]) -> list[tuple[Frame, Reconstruction]]:
        """What was made of earlier frames, of the objects `ids`."""
        left = [
            (frame, replace(made, objects=[o for o in made.objects if o.object_id in ids]))
            for frame, made in self._made
        ]
        return [(frame, made) for frame, made in left if made.objects]

    def _followed(
        self,
        frame: Frame,
        next_id: int,
        mended: frozenset[int],
        aside: NDArray[np.int64] | None,
    ) -> Followed:
        """What to follow into the next frame; aside : (H, W) masks that were left out."""
        lost: tuple[Lost, ...] = ()
        if self._last is not None:
            lost = lost_tracks(self._last.frame, self._last.lost, frame, self._config)
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
