"""Poses of recognised objects as the BOP benchmark's results file has them.

A CSV with the columns scene_id, im_id, obj_id, score, R, t, time (Hodan et al., BOP toolkit): R row
by row, t in millimetres, both from the object's mesh file to the camera; time in seconds for the
image.
"""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path

from brrp_cli.reconstruction import Reconstruction

HEADER = ("scene_id", "im_id", "obj_id", "score", "R", "t", "time")
# The numbers that the YCB-Video data set gives to YCB objects.
YCBV = (2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 19, 21, 24, 25, 35, 36, 37, 40, 51, 52, 61)


def bop_id(name: str, names: list[str]) -> int:
    """The number of an object: of `obj_000012` 12, of a YCB object of YCB-Video its number there,
    of others their place, from 1, among the prior's names."""
    given = re.fullmatch(r"obj_0*(\d+)", name)
    if given:
        return int(given[1])
    ycb = re.match(r"(\d{3})_[a-z]", name)
    if ycb and int(ycb[1]) in YCBV:
        return YCBV.index(int(ycb[1])) + 1
    return sorted(names).index(name) + 1


def image_ids(source: Path | None) -> tuple[int, int]:
    """Scene and image of a frame, from the last two numbers of its path; 0 where there is none."""
    numbers = [int(part) for part in re.findall(r"(?<!\d)(\d{4,6})(?!\d)", str(source or ""))]
    scene, image = ([0, 0, *numbers])[-2:]
    return scene, image


def bop_rows(result: Reconstruction, names: list[str]) -> list[tuple[str, ...]]:
    """One row for each recognised object; the score is the weight of the placement's object."""
    scene, image = image_ids(result.frame.source)
    seconds = sum(result.seconds.values()) + sum(sum(o.seconds.values()) for o in result.objects)
    rows: list[tuple[str, ...]] = []
    for item in result.objects:
        found = item.recognised
        if found is None or found.T_cam_mesh is None:
            continue
        R, t = found.T_cam_mesh[:3, :3], found.T_cam_mesh[:3, 3] * 1000
        rows.append(
            (
                str(scene),
                str(image),
                str(bop_id(found.name, names)),
                f"{found.weight or found.probability:.4f}",
                " ".join(f"{value:.9f}" for value in R.ravel()),
                " ".join(f"{value:.6f}" for value in t),
                f"{seconds:.4f}",
            )
        )
    return rows


def bop_csv(result: Reconstruction, names: list[str]) -> str:
    """The file's text."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADER)
    writer.writerows(bop_rows(result, names))
    return text.getvalue()
