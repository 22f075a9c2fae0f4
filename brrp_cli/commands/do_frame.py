"""How `brrp reconstruct` does a frame: on its own, or as one of a stream."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brrp_cli.commands.made_masks import MadeMasks, tell_made, tell_mended

if TYPE_CHECKING:
    from brrp_cli.commands.source_options import SourceOptions
    from brrp_cli.config.segmentation import SegmentConfig
    from brrp_cli.executors.helpers import Helpers
    from brrp_cli.frames.frame import Frame
    from brrp_cli.reconstruction import Reconstruction

# (frame, how its masks were made if brrp made them before, the folder to be written) -> its
# objects. What there is to say of masks is said, and drawn beside the folder.
DoFrame = Callable[["Frame", MadeMasks | None, Path], "Reconstruction"]


def on_its_own(given: dict[str, Any], helpers: Helpers) -> DoFrame:
    """`given`: what `brrp_cli.reconstruct` takes besides the frame and the helpers."""
    from brrp_cli.api import reconstruct, try_masks
    from brrp_cli.mending.again import Again
    from brrp_cli.mending.mend import mend
    from brrp_cli.registration.exchanged_colours import ColourCheck
    from brrp_cli.retrieval.base import one_image

    run: Callable[..., Reconstruction] = partial(reconstruct, **given, helpers=helpers)
    again = Again(run, partial(try_masks, **given, helpers=helpers))
    ask_colours = ColourCheck(given["prior"])

    def do(frame: Frame, masks: MadeMasks | None, output: Path) -> Reconstruction:
        with one_image(given["retriever"]):
            result = run(frame)
            if masks is not None:
                result = mend(
                    result,
                    given["prior"],
                    again,
                    masks.config,
                    masks.aside,
                    corrected=masks.corrected,
                )
        ask_colours(result)
        helpers.start()
        if masks is None:
            return result
        tell_mended(frame, result.frame, output)
        return replace(result, segmentation=asdict(masks.config))

    return do


def in_a_stream(given: dict[str, Any], source: SourceOptions, masks: SegmentConfig) -> DoFrame:
    """The same; objects keep their ids from frame to frame, and what rests its result.

    masks : the numbers by which they are made, of frames that have none
    """
    from brrp_cli.session import Reconstructor

    if source.keep_all:
        raise click.UsageError("--all and --track exclude each other: a stream has whole objects")
    session = Reconstructor(
        **given,
        prompt=source.prompt,
        masks_dir=source.masks_dir,
        segmentation=masks,
        track=True,
    )

    def do(frame: Frame, _: MadeMasks | None, output: Path) -> Reconstruction:
        result = session(frame)
        if not frame.object_ids:
            tell_made(result.frame, source.prompt, output)
        elif result.segmentation is not None:
            tell_mended(frame, result.frame, output)
        return result

    return do
