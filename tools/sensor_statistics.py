"""How do made depth images compare with those of real cameras?

    python tools/sensor_statistics.py [--real FOLDER] [--made SENSOR=SCENES ...] [--markdown]

FOLDER holds NAME/color.png and NAME/depth.png (16 bit, millimetres) with NAME/intrinsics.json (fx,
fy, cx, cy), or one camera_params.json (fx, fy, x_offset, y_offset) for those without. SCENES is a
set of tools/make_scenes.py. One line for each real frame and one for each set (medians over its
views, and the 10th to 90th percentile).

- waves, fine: standard deviation, mm along the ray, of the table's residual from its plane, smooth
  over 20 pixels and the rest
- face waves, face fine: the same on flat faces of objects
- step: gaps between depth values beyond 1.8 m, in mm at 1 m; nearer, whole millimetres hide it
- holes: share of the table's outline, and of what stands in front of it, without return
- flying: pixels between the table's depth and a thing's, at silhouettes
- left, right, top: missing pixels at silhouettes on that side of a thing
- ragged: pixels, spread of the depth's silhouettes about those in the colour image
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message
from tabletop.depth_statistics import (
    edge_offsets,
    face_residuals,
    holes,
    quantisation_step,
    silhouettes,
    table_residual,
    waves_and_fine,
)

from brrp_cli.errors import BrrpError
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.frame import Frame
from brrp_cli.ground_truth.scenes import find_scenes
from brrp_cli.segmentation.segment import segment

FAR = 1.8  # metres: beyond, a step of disparity is larger than the unit of a millimetre
COLUMNS = (
    "distance",
    "waves",
    "fine",
    "face waves",
    "face fine",
    "step",
    "holes",
    "flying",
    "left",
    "right",
    "top",
    "ragged",
)
UNITS = ("m", "mm", "mm", "mm", "mm", "mm", "%", "px", "px", "px", "px", "px")


def statistics(frame: Frame) -> dict[str, float]:
    """The columns of one frame, whose masks are used for faces. Errors: FrameError, no table."""
    depth = np.nan_to_num(frame.points[..., 2]).astype(np.float64)
    table = table_residual(depth, frame.K)
    waves, fine = waves_and_fine(table.residual, table.table)
    found = silhouettes(table.residual)
    faces = np.array(face_residuals(depth, frame.K, frame.segmap)).reshape(-1, 2)
    face_waves, face_fine = np.median(faces, axis=0) if len(faces) else (np.nan, np.nan)
    far = depth > FAR
    values = (
        float(np.median(depth[table.table])),
        1e3 * waves,
        1e3 * fine,
        1e3 * face_waves,
        1e3 * face_fine,
        1e3 * quantisation_step(depth, far) if far.sum() > 5000 else float("nan"),
        100 * holes(depth, table.region),
        found.flying,
        found.holes_left,
        found.holes_right,
        found.holes_top,
        edge_offsets(frame.rgb, found.edges),
    )
    return dict(zip(COLUMNS, map(float, values), strict=True))


def real_frames(folder: Path) -> Iterator[Frame]:
    """Each frame of the folder, with masks by `segment`."""
    for path in sorted(folder.glob("*/depth.png")):
        frame = read_real(path.parent)
        yield replace(frame, segmap=segment(frame))


def read_real(folder: Path) -> Frame:
    """One real frame, without masks."""
    own = folder / "intrinsics.json"
    shared = folder.parent / "camera_params.json"
    numbers = json.loads((own if own.exists() else shared).read_text())
    cx = numbers.get("cx", numbers.get("x_offset"))
    cy = numbers.get("cy", numbers.get("y_offset"))
    K = np.array([[numbers["fx"], 0, cx], [0, numbers["fy"], cy], [0, 0, 1]])
    rgb = np.asarray(Image.open(folder / "color.png").convert("RGB"))
    depth = np.asarray(Image.open(folder / "depth.png")).astype(np.uint16)
    return make_frame(rgb=rgb, depth=depth, K=K, source=folder)


def made_frames(scenes: Path) -> Iterator[Frame]:
    """Every view of a set."""
    for scene in find_scenes(scenes):
        for view in range(len(scene.views)):
            yield scene.view(view)


def summary(rows: list[dict[str, float]]) -> dict[str, tuple[float, float, float]]:
    """Median, 10th and 90th percentile of each column, NaN where no row has a value."""
    table: NDArray[np.float64] = np.array([[row[name] for name in COLUMNS] for row in rows])
    some = np.isfinite(table).any(axis=0)
    result = np.full((3, len(COLUMNS)), np.nan)
    result[:, some] = np.nanpercentile(table[:, some], [50, 10, 90], axis=0)
    return dict(zip(COLUMNS, map(tuple, result.T.tolist()), strict=True))


def _text(value: float) -> str:
    return "-" if not np.isfinite(value) else f"{value:.2f}" if value < 10 else f"{value:.1f}"


def _print(name: str, cells: list[str], markdown: bool) -> None:
    if markdown:
        print(f"| {name} | " + " | ".join(cells) + " |")
    else:
        print(f"{name:18s}" + "".join(f"{cell:>18s}" for cell in cells))


@one_message()
def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--real", type=Path)
    parser.add_argument("--made", action="append", default=[], metavar="SENSOR=SCENES")
    parser.add_argument("--markdown", action="store_true")
    options = parser.parse_args()
    _print("", [f"{c} ({u})" for c, u in zip(COLUMNS, UNITS, strict=True)], options.markdown)
    if options.markdown:
        print("| --- |" + " --- |" * len(COLUMNS))
    if options.real:
        for frame in real_frames(options.real):
            row = statistics(frame)
            _print(Path(str(frame.source)).name, [_text(row[c]) for c in COLUMNS], options.markdown)
    for text in options.made:
        name, _, folder = text.partition("=")
        rows = []
        for frame in made_frames(Path(folder)):
            try:
                rows.append(statistics(frame))
            except BrrpError as error:
                print(f"left out: {error}", file=sys.stderr)
        found = summary(rows)
        cells = [
            f"{_text(m)} ({_text(low)}-{_text(high)})" if np.isfinite(m) else "-"
            for m, low, high in (found[c] for c in COLUMNS)
        ]
        _print(f"{name} ({len(rows)})", cells, options.markdown)


if __name__ == "__main__":
    main()
