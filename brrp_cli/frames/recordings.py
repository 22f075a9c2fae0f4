"""What recorders leave behind: folders of colour and depth images with one intrinsics file."""

from __future__ import annotations

import logging
from pathlib import Path

from brrp_cli.errors import FrameError
from brrp_cli.frames.format import Format, FrameRequest, pick
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.images import read_images

log = logging.getLogger(__name__)

COLOUR_ENDINGS = (".png", ".jpg", ".jpeg")
DEPTH_ENDINGS = (".png", ".tif", ".tiff", ".npy")


def recording(title: str, intrinsics: str, unit: str) -> Format:
    """The format of a folder with color/NAME.jpg, depth/NAME.png, aligned to the colour camera, and
    the file `intrinsics` of that camera. unit : as in `read_pair`."""

    def read(folder: Path, request: FrameRequest) -> Frame:
        """The frame that --index names or counts, the first else. Errors: FrameError."""
        return read_pair(pairs_below(folder), folder / intrinsics, request, folder, unit)

    return Format(
        title=title,
        layout=f"color/, depth/, {intrinsics}",
        matches=lambda path: (path / intrinsics).is_file() and (path / "color").is_dir(),
        read=read,
        names=lambda path, request: list(pairs_below(path)),
    )


def pairs_below(folder: Path, color: str = "color") -> dict[str, tuple[Path, Path]]:
    """Name -> (colour, depth) of the images in the folders `color` and depth/."""
    colours = images_in(folder / color, COLOUR_ENDINGS)
    return by_name(colours, images_in(folder / "depth", DEPTH_ENDINGS))


def images_in(folder: Path, endings: tuple[str, ...]) -> dict[str, Path]:
    """Stem -> file of the folder's images, by name."""
    if not folder.is_dir():
        return {}
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in endings)
    return {path.stem: path for path in files}


def read_pair(
    pairs: dict[str, tuple[Path, Path]],
    intrinsics: Path,
    request: FrameRequest,
    where: Path,
    unit: str,
) -> Frame:
    """One of the pairs of colour and depth images; integers of depth are millimetres unless the
    user says otherwise, which is said. Errors: FrameError.

    pairs : name -> (colour, depth); unit : why millimetres are right, for the note
    """
    if not pairs:
        raise FrameError(
            "No colour image has a depth image of its name",
            where=where,
            expected="color/NAME.jpg and depth/NAME.png",
        )
    names = list(pairs)
    colour, depth = pairs[pick(names, request.index, names, where)]
    intrinsics = request.intrinsics or intrinsics
    log.info("Frame: %s and %s, intrinsics %s", colour.name, depth.name, intrinsics)
    if request.depth_scale is None and intrinsics.suffix != ".mat":
        log.info("Depth that is integers is millimetres: %s", unit)
    return read_images(colour, depth, intrinsics, depth_scale=request.depth_scale)


def by_name(colours: dict[str, Path], depths: dict[str, Path]) -> dict[str, tuple[Path, Path]]:
    """Pairs of images that have one stem."""
    return {stem: (path, depths[stem]) for stem, path in colours.items() if stem in depths}
