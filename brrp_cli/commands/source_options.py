"""Options that say where a frame comes from and how its masks are made, of several commands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brrp_cli.errors import FrameError
from brrp_cli.files import exists
from brrp_cli.progress import note
from brrp_cli.spoken import counted

if TYPE_CHECKING:
    from brrp_cli.config.segmentation import SegmentConfig
    from brrp_cli.frames.format import FrameRequest
    from brrp_cli.frames.frame import Frame
    from brrp_cli.segmentation.prompted.segment_by_prompt import PromptSegmenter

_PATH = click.Path(path_type=Path)
_OPTIONS = [
    click.option("--color", type=_PATH, help="Colour image (PNG, JPEG)."),
    click.option(
        "--depth",
        type=_PATH,
        help="Depth aligned to it: 16-bit PNG, TIFF or .npy. Integers are millimetres, floats "
        "metres.",
    ),
    click.option(
        "--intrinsics",
        type=_PATH,
        help="JSON: fx, fy and cx, cy (ppx, ppy; x_offset, y_offset), a 3 x 3 K, a ROS "
        "camera_info; or GraspNet's meta.mat.",
    ),
    click.option(
        "--masks",
        type=_PATH,
        help="Object ids: grey PNG or .npy, 0 = background. With a SOURCE in place of its own.",
    ),
    click.option(
        "--camera-pose",
        type=_PATH,
        help="T_world_cam, camera to world, metres: 4 x 4 as JSON, .npy or text.",
    ),
    click.option(
        "--all",
        "keep_all",
        is_flag=True,
        help="With masks from depth: also of what the image's border cuts or that stands"
        " nowhere on the table.",
    ),
    click.option("--index", metavar="N|NAME", help="Which frame, where SOURCE holds many."),
    click.option("--list", "lists", is_flag=True, help="Only say what SOURCE holds."),
    click.option("--color-topic", help="Topic of a ROS bag, if several fit."),
    click.option("--depth-topic", help="Topic of a ROS bag, aligned to colour."),
    click.option("--depth-scale", type=float, help="Metres in one unit of depth."),
    click.option(
        "--prompt",
        metavar="TEXT",
        help='Make masks by learned models: "small object", or several, "mug, box".',
    ),
    click.option(
        "--masks-dir", type=_PATH, help="Folder with those models. [default: the fetched]"
    ),
]


def source_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options; they reach the command as its keyword `source`, a `SourceOptions`."""
    names = ["color", "depth", "intrinsics", "masks", "camera_pose", "index", "color_topic"]
    names += ["depth_topic", "depth_scale", "prompt", "masks_dir", "keep_all"]

    # Its help, and the options that decorators below have left there, come along.
    @wraps(function)
    def command(**values: Any) -> Any:
        options = SourceOptions(values.pop("path"), **{name: values.pop(name) for name in names})
        if values.pop("lists"):
            from brrp_cli.commands.source_list import print_list

            return print_list(options, as_json=values.get("as_json", False))
        return function(source=options, **values)

    wrapped: Callable[..., Any] = command
    for option in reversed(_OPTIONS):
        wrapped = option(wrapped)
    return click.argument("path", metavar="[SOURCE]", type=_PATH, required=False)(wrapped)


def require_output(output: Path | None) -> Path:
    """What -o names. UsageError without it, which only --list does without."""
    if output is None:
        raise click.UsageError("Missing option '-o' / '--output'.")
    return output


@dataclass(frozen=True)
class SourceOptions:
    """What was typed. `path` is SOURCE; it and the images of one frame exclude each other."""

    path: Path | None
    color: Path | None = None
    depth: Path | None = None
    intrinsics: Path | None = None
    masks: Path | None = None
    camera_pose: Path | None = None
    index: str | None = None
    color_topic: str | None = None
    depth_topic: str | None = None
    depth_scale: float | None = None
    prompt: str | None = None
    masks_dir: Path | None = None
    keep_all: bool = False

    def check(self) -> None:
        """UsageError for what does not go together."""
        images = {"--color": self.color, "--depth": self.depth, "--intrinsics": self.intrinsics}
        given = [name for name, path in images.items() if path is not None]
        if self.path is not None and (self.color or self.depth):
            raise click.UsageError("give either SOURCE or --color, --depth and --intrinsics")
        if self.path is None and len(given) < len(images):
            lacking = ", ".join(name for name in images if name not in given)
            raise click.UsageError(f"missing {lacking} (or give a file or folder as SOURCE)")
        if self.path is None and (self.index or self.color_topic or self.depth_topic):
            raise click.UsageError("--index and topics choose from a SOURCE, not from images")
        if self.masks is not None and self.prompt is not None:
            raise click.UsageError("--masks and --prompt exclude each other")
        if self.keep_all and (self.masks is not None or self.prompt is not None):
            raise click.UsageError("--all goes with masks that are made from depth")
        if self.masks_dir is not None and self.prompt is None:
            raise click.UsageError("--masks-dir goes with --prompt")
        for path in (self.path, self.color, self.depth, self.intrinsics, self.masks):
            # Told before what takes long to import.
            if path is not None and not exists(path):
                raise FrameError("No such file or folder", where=path, fix="check the path")

    @property
    def name(self) -> Path:
        """Where results that are not named lie: beside the source, and named after it."""
        origin = self.path or self.color or Path("frame")
        return origin.with_name(origin.stem if origin.is_file() else origin.resolve().name)

    @property
    def request(self) -> FrameRequest:
        """What is asked for beside the path."""
        from brrp_cli.frames.format import FrameRequest

        return FrameRequest(
            index=self.index,
            depth_scale=self.depth_scale,
            intrinsics=self.intrinsics,
            color_topic=self.color_topic,
            depth_topic=self.depth_topic,
        )

    def reads(self, path: Path) -> bool:
        """Whether that is one of the files that were named."""
        named = (self.path, self.color, self.depth, self.intrinsics, self.masks, self.camera_pose)
        return any(each is not None and each.resolve() == path.resolve() for each in named)

    def read(self) -> Frame:
        """The frame, with the masks and the pose that were named or else are there. Errors:
        FrameError."""
        from dataclasses import replace

        from brrp_cli.frames.images import given_masks, read_images
        from brrp_cli.frames.pose_file import read_pose
        from brrp_cli.frames.readers import read_frame

        pose = None if self.camera_pose is None else read_pose(self.camera_pose)
        if self.path is not None:
            frame = read_frame(self.path, request=self.request)
            if self.masks is not None:
                tell_replaced(frame)
                frame = frame.with_masks(given_masks(self.masks, frame.shape))
        else:
            assert self.color is not None and self.depth is not None
            assert self.intrinsics is not None
            frame = read_images(
                self.color, self.depth, self.intrinsics, self.masks, depth_scale=self.depth_scale
            )
        return frame if pose is None else replace(frame, T_world_cam=pose)

    def names(self) -> list[str]:
        """The frames of SOURCE, as --index names them. Errors: FrameError."""
        from brrp_cli.frames.readers import list_frames

        assert self.path is not None
        return list_frames(self.path, self.request)

    def make_masks(self, frame: Frame, seed: int, config: SegmentConfig | None = None) -> Frame:
        """The frame with masks made anew, by the prompt where there is one, else from depth, and
        those that were left out.

        Errors: FrameError if nothing is found; MaskError if the models cannot be used.
        """
        import numpy as np

        from brrp_cli.segmentation.segment import segment_and_aside

        if self.prompt is None:
            return frame.with_masks(*segment_and_aside(frame, seed, config, keep_all=self.keep_all))
        segmap = _prompt_segmenter(self.masks_dir, config)(frame, self.prompt, seed)
        return frame.with_masks(segmap, np.zeros_like(segmap))


def tell_replaced(frame: Frame) -> None:
    """Say where a frame has masks that are not used."""
    if frame.object_ids:
        old = counted(len(frame.object_ids), "object")
        note(f"Masks: those of the source, {old}, are replaced")


@cache
def _prompt_segmenter(masks_dir: Path | None, config: SegmentConfig | None) -> PromptSegmenter:
    """Its models are loaded once for all frames of a command."""
    from brrp_cli.segmentation.prompted.segment_by_prompt import PromptSegmenter

    return PromptSegmenter(masks_dir, config)
