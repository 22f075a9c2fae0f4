"""Draw reconstructed objects in their colours, from the camera's side and from behind.

    python tools/draw_objects.py out/ bowl plate mug clamp -o objects.png
    python tools/draw_objects.py out/ other/ 1 7 -o objects.png

An object is named by its id, or by a part of the name that it was recognised as; without names, all
objects are drawn. One column for each object: as the camera saw it above, from behind below. Every
object fills its picture, so that their sizes do not compare.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from both_sides import both_sides
from one_message import one_message

from brrp_cli.api import open_result
from brrp_cli.results.read import StoredResult

SIZE = 300  # pixels of a picture
LABEL = 18  # pixels


def column(result: StoredResult, object_id: int, name: str) -> NDArray[np.uint8]:
    """(LABEL + 2 SIZE, SIZE, 3) uint8: an object from the camera's side and from behind."""
    pictures = both_sides(result, [result.surfaces[object_id]], SIZE)
    label = Image.new("RGB", (SIZE, LABEL), "white")
    ImageDraw.Draw(label).text((6, 3), name, fill="black")
    return np.vstack([np.asarray(label), *pictures])


def wanted(result: StoredResult, names: list[str]) -> list[tuple[int, str]]:
    """Ids of the objects to draw, with what is written above them."""
    found = []
    for item in result.record["objects"]:
        name = item["recognised"] or f"object {item['id']}"
        by_name = any(not n.isdigit() and n in name for n in names)
        if item["mesh"] and (not names or str(item["id"]) in names or by_name):
            found.append((item["id"], name))
    return found


@one_message()
def main() -> None:
    """Write the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", nargs="+", metavar="OUT/ ... OBJECT ...")
    parser.add_argument("-o", "--output", type=Path, required=True)
    options = parser.parse_args()
    folders = [Path(text) for text in options.what if Path(text).is_dir()]
    names = [text for text in options.what if not Path(text).is_dir()]
    columns = []
    for result in map(open_result, folders):
        columns += [column(result, number, name) for number, name in wanted(result, names)]
    if not columns:
        parser.error(f"no such object in {', '.join(map(str, folders)) or 'any folder'}")
    picture = Image.fromarray(np.hstack(columns))
    picture.quantize(256, dither=Image.Dither.NONE).save(options.output, optimize=True)
    print(options.output)


if __name__ == "__main__":
    main()
