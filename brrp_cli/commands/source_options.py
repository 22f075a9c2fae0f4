"""Options that say where a frame comes from and how its masks are made, of several commands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from brrp_cli.config.segmentation import SegmentConfig
    from brrp_cli.frames.frame import Frame

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
        "camera_info.",
    ),
    click.option("--masks", type=_PATH, help="Object ids: grey PNG or .npy, 0 = background."),
    click.option(
        "--all",
        "keep_all",
        is_flag=True,
        help="With masks without a model: also of what the image's border cuts or that stands"
        " nowhere on the table.",
    ),
    click.option("--index", metavar="N|NAME", help="Which frame, where SOURCE holds many."),
    click.option("--color-topic", help="Of a ROS bag, where several would do."),
    click.option("--depth-topic", help="Of a ROS bag; aligned to the colour camera."),
    click.option("--depth-scale", type=float, help="Metres that one unit of depth is."),
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
    names = ["color", "depth", "intrinsics", "masks", "index", "color_topic", "depth_topic"]
    names += ["depth_scale", "prompt", "masks_dir", "keep_all"]

    # Its help, and the options that decorators below have left there, come along.
    @wraps(function)
    def command(**values: Any) -> Any:
        options = SourceOptions(values.pop("path"), **{name: values.pop(name) for name in names})
        return function(source=options, **values)

    wrapped: Callable[..., Any] = command
    for option in reversed(_OPTIONS):
        wrapped = option(wrapped)
    return click.argument("path", metavar="[SOURCE]", type=_PATH, required=False)(wrapped)


@dataclass(frozen=True)
class SourceOptions:
    """What was typed. `path` is SOURCE; it and the three image files exclude each other."""

    path: Path | None
    color: Path | None = None
    depth: Path | None = None
    intrinsics: Path | None = None
    masks: Path | None = None
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
        if self.path is not None and (self.color or self.depth or self.masks):
            raise click.UsageError("give either SOURCE or --color, --depth and --intrinsics")
        if self.path is None and len(given) < len(images):
            lacking = ", ".join(name for name in images if name not in given)
            raise click.UsageError(f"missing {lacking} (or give a file or folder as SOURCE)")
        if self.path is None and (self.index or self.color_topic or self.depth_topic):
            raise click.UsageError("--index and topics choose from a SOURCE, not from images")
        if self.masks is not None and self.prompt is not None:
            raise click.UsageError("--masks and --prompt exclude each other")
        if self.keep_all and (self.masks is not None or self.prompt is not None):
            raise click.UsageError("--all goes with masks that are made without a model")
        if self.masks_dir is not None and self.prompt is None:
            raise click.UsageError("--masks-dir goes with --prompt")

    @property
    def name(self) -> Path:
        """Where results that are not named lie: beside the source, and named after it."""
        origin = self.path or self.color or Path("frame")
        return origin.with_name(origin.stem if origin.is_file() else origin.resolve().name)

    def read(self) -> Frame:
        """The frame, with the masks that it comes with. Errors: FrameError."""
        from brrp_cli.frames.format import Request
        from brrp_cli.frames.images import read_images
        from brrp_cli.frames.readers import read_frame

        if self.path is not None:
            request = Request(
                index=self.index,
                depth_scale=self.depth_scale,
                intrinsics=self.intrinsics,
                color_topic=self.color_topic,
                depth_topic=self.depth_topic,
            )
            return read_frame(self.path, request=request)
        assert self.color is not None and self.depth is not None and self.intrinsics is not None
        return read_images(
            self.color, self.depth, self.intrinsics, self.masks, depth_scale=self.depth_scale
        )

    def make_masks(self, frame: Frame, seed: int, config: SegmentConfig | None = None) -> Frame:
        """The frame with masks made anew: by the prompt where there is one, else without a model.

        Errors: FrameError if nothing is found; MaskError if the models cannot be used.
        """
        from dataclasses import replace

        from brrp_cli.segmentation.segment import segment

        if self.prompt is None:
            return replace(frame, segmap=segment(frame, seed, config, keep_all=self.keep_all))
        from brrp_cli.segmentation.prompted.segment_by_prompt import PromptSegmenter

        segmenter = PromptSegmenter(self.masks_dir, config)
        return replace(frame, segmap=segmenter(frame, self.prompt, seed))
