"""Poses of recognised objects as the BOP benchmark's results file has them.

A CSV with the columns scene_id, im_id, obj_id, score, R, t, time (Hodan et al., BOP toolkit): R row
by row, t in millimetres, both from the object's mesh file to the camera; time in seconds for the
image.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

HEADER = ("scene_id", "im_id", "obj_id", "score", "R", "t", "time")
# The numbers that the YCB-Video data set gives to YCB objects.
YCBV = (2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 19, 21, 24, 25, 35, 36, 37, 40, 51, 52, 61)


def bop_id(name: str, names: Sequence[str]) -> int:
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
    scene, image = ([0, 0, *_numbers(str(source or ""))])[-2:]
    return scene, image


def numbers_image(source: Path | None) -> bool:
    """Whether a frame's own name holds the number that `image_ids` takes for its image: one of a
    folder above it, such as a year, is the same for all its frames."""
    return source is not None and bool(_numbers(source.name))


def _numbers(text: str) -> list[int]:
    return [int(part) for part in re.findall(r"(?<!\d)(\d{4,6})(?!\d)", text)]


def bop_rows(record: Mapping[str, Any], names: Sequence[str]) -> list[tuple[str, ...]]:
    """One row for each recognised object; the score is the weight of the placement's object.

    record : result.json; names : of the prior's objects
    """
    source = record["source"]
    scene, image = image_ids(None if source is None else Path(source))
    objects = record["objects"]
    seconds = sum(sum(each["seconds"].values()) for each in [record, *objects])
    rows: list[tuple[str, ...]] = []
    for item in objects:
        placed = [
            each
            for each in item["retrieved"]
            if each["name"] == item["recognised"] and each["T_cam_mesh"] is not None
        ]
        if not placed:
            continue
        found = max(placed, key=lambda each: each["weight"] or 0.0)
        T_cam_mesh = np.asarray(found["T_cam_mesh"])
        rows.append(
            (
                str(scene),
                str(image),
                str(bop_id(found["name"], names)),
                f"{found['weight'] or found['probability']:.4f}",
                " ".join(f"{value:.9f}" for value in T_cam_mesh[:3, :3].ravel()),
                " ".join(f"{value:.6f}" for value in T_cam_mesh[:3, 3] * 1000),
                f"{seconds:.4f}",
            )
        )
    return rows


def bop_csv(record: Mapping[str, Any], names: Sequence[str]) -> str:
    """The file's text; arguments as for `bop_rows`."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADER)
    writer.writerows(bop_rows(record, names))
    return text.getvalue()
