"""Draw depth images of real and made frames side by side, for docs/sensors.md.

    python tools/draw_sensors.py RealSense=REAL/sugar_box stereo=SCENES/00000000/0000 ... -o PNG

Each frame is a real one (color.png, depth.png) or a view of a made scene, and gives a row: colour,
depth, and what depth deviates from the table's plane (red nearer than the plane, blue farther, full
colour at 8 mm, grey for what stands on it). Black has no return.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message
from sensor_statistics import read_real
from tabletop.depth_statistics import table_residual

from brrp_cli.frames.frame import Frame
from brrp_cli.frames.published import read_published

FULL = 0.008  # metres of deviation at full colour
OFF_TABLE = 0.02  # metres
SIZE = (320, 240)


def row(frame: Frame, name: str) -> NDArray[np.uint8]:
    """(h, 3 w, 3) uint8: one frame's pictures."""
    from matplotlib import colormaps

    depth = np.nan_to_num(frame.points[..., 2]).astype(np.float64)
    residual = table_residual(depth, frame.K).residual
    low, high = np.percentile(depth[depth > 0], [2, 95])
    near = colormaps["turbo_r"](np.clip((depth - low) / (high - low), 0, 1))[..., :3]
    bent = colormaps["RdBu"](np.clip(np.nan_to_num(residual) / FULL, -1, 1) / 2 + 0.5)[..., :3]
    bent[np.abs(np.nan_to_num(residual)) > OFF_TABLE] = 0.5
    pictures = [frame.rgb]
    for image in (near, bent):
        image[depth == 0] = 0
        pictures.append((255 * image).astype(np.uint8))
    # Colours of depth are not mixed: what lies between two of them was never measured.
    smaller = [
        np.asarray(Image.fromarray(p).resize(SIZE, Image.Resampling.NEAREST)) for p in pictures
    ]
    joined = Image.fromarray(np.hstack(smaller))
    ImageDraw.Draw(joined).text((6, 4), name, fill="white", stroke_width=2, stroke_fill="black")
    return np.asarray(joined)


@one_message()
def main() -> None:
    """Write the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("frames", nargs="+", metavar="NAME=FOLDER")
    parser.add_argument("-o", "--output", type=Path, required=True)
    options = parser.parse_args()
    rows = []
    for text in options.frames:
        name, _, folder = text.rpartition("=")
        real = (Path(folder) / "color.png").exists()
        rows.append(row(read_real(Path(folder)) if real else read_published(folder), name))
    picture = Image.fromarray(np.vstack(rows))
    # A palette keeps the file small.
    picture.quantize(256, dither=Image.Dither.NONE).save(options.output, optimize=True)
    print(options.output)


if __name__ == "__main__":
    main()
