"""Masks that brrp made, on the way or before, and their picture beside the results."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

import click

from brrp_cli.files import refuse_existing
from brrp_cli.progress import note
from brrp_cli.spoken import counted

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from brrp_cli.commands.source_options import SourceOptions
    from brrp_cli.config.segmentation import SegmentConfig
    from brrp_cli.frames.frame import Frame
    from brrp_cli.reconstruction import Reconstruction


@dataclass(frozen=True)
class MadeMasks:
    """How the masks of a frame were made, which (H, W) were left out, 0 = none, and which ids were
    corrected since."""

    config: SegmentConfig
    aside: NDArray[np.int64] | None
    corrected: frozenset[int] = frozenset()


def masks_asked(source: SourceOptions) -> dict[str, Any]:
    """What decides which masks are made on the way, besides numbers, as result.json holds it."""
    return {"prompt": source.prompt, "all": source.keep_all}


def make_masks(
    source: SourceOptions,
    frame: Frame,
    output: Path,
    seed: int,
    config: SegmentConfig,
    *,
    overwrite: bool,
) -> tuple[Frame, MadeMasks]:
    """The frame with masks made on the way; a picture of them is written beside the output."""
    from brrp_cli.frames.build import require_objects

    picture = _picture(output)
    refuse_existing(picture, overwrite=overwrite)
    frame = require_objects(source.make_masks(frame, seed, config))
    tell_made(frame, source.prompt, output)
    return frame.with_masks(frame.segmap), MadeMasks(config, frame.aside)


def own_or_made_masks(
    source: SourceOptions,
    frame: Frame,
    output: Path,
    seed: int,
    config: SegmentConfig,
    *,
    overwrite: bool,
) -> tuple[Frame, MadeMasks | None]:
    """The frame with its own masks, as `masks_of`; where it has none, or a prompt asks for others,
    as `make_masks`. UsageError for --all of a frame that has masks."""
    if source.prompt is not None or not frame.object_ids:
        return make_masks(source, frame, output, seed, config, overwrite=overwrite)
    if source.keep_all:
        raise click.UsageError(
            "--all is of masks that are made, and the frame has some:"
            " brrp segment SOURCE --again --all makes them anew"
        )
    return masks_of(frame, output, config, overwrite=overwrite)


def tell_made(frame: Frame, prompt: str | None, output: Path) -> None:
    """Draw masks that were made on the way, and say so."""
    from brrp_cli.segmentation.mask_picture import write_picture

    picture = _picture(output)
    write_picture(frame, picture)
    how = f"the prompt {prompt!r}" if prompt else "what stands on the table"
    note(
        f"Masks: made on the way from {how}, {counted(len(frame.object_ids), 'object')}: {picture}"
    )
    note(
        f"  to correct them: brrp segment {quote(str(output / 'frame.npz'))} --merge 1,2 --split 3"
        " --drop 4 -o NEW.npz"
    )


def masks_of(
    frame: Frame, output: Path, config: SegmentConfig, *, overwrite: bool
) -> tuple[Frame, MadeMasks | None]:
    """A frame that has masks, and how they were made; None where brrp did not make them."""
    if frame.aside is None:
        return frame, None
    refuse_existing(_picture(output), overwrite=overwrite)
    made = MadeMasks(config, frame.aside, frame.corrected)
    return frame.with_masks(frame.segmap), made


def tell_mended(before: Frame, after: Frame, output: Path) -> None:
    """Where recognised objects mended the masks, say so and draw them again."""
    import numpy as np

    from brrp_cli.segmentation.mask_picture import write_picture

    if np.array_equal(before.segmap, after.segmap):
        return
    picture = _picture(output)
    write_picture(after, picture)
    pixels = int((before.segmap != after.segmap).sum())
    note(
        f"Masks: mended by recognised objects in {counted(pixels, 'pixel')},"
        f" {counted(len(before.object_ids), 'object')} before,"
        f" {len(after.object_ids)} after: {picture}"
    )


def forget_picture(
    read: Frame, result: Reconstruction, source: SourceOptions, output: Path
) -> None:
    """Remove the picture of earlier masks, where results of `read` took the place of others and no
    picture of their masks was drawn."""
    import numpy as np

    mended = not np.array_equal(read.segmap, result.frame.segmap)
    if result.segmentation is None or not (source.prompt or mended):
        forget([_picture(output)], source)


def forget(pictures: Iterable[Path], source: SourceOptions) -> None:
    """Remove pictures of masks that were replaced, unless they are masks that the user named."""
    for picture in pictures:
        if not source.reads(picture):
            picture.unlink(missing_ok=True)


def pictures_of(output: Path) -> tuple[Path, Path]:
    """Beside a frame file: the picture of its masks, and their ids as an image."""
    return output.with_suffix(".masks.png"), output.with_suffix(".ids.png")


def _picture(output: Path) -> Path:
    return output.with_name(output.name + ".masks.png")
