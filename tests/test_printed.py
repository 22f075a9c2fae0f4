"""What is printed of results, and what a notebook shows: a few lines, without arrays."""

from __future__ import annotations

import base64
import io
import re

import numpy as np
import pytest
from made_result import write_made_result
from PIL import Image

from brrp_cli import open_result
from brrp_cli.reconstruction import (
    METRES,
    OK,
    TOO_FEW_POINTS,
    ObjectReconstruction,
    Reconstruction,
    Retrieved,
    Surface,
)


def result(frame, count: int) -> Reconstruction:
    surface = Surface(
        np.zeros((3, 3)), np.array([[0, 1, 2]]), np.full(3, 0.0012, np.float32), METRES
    )
    found = ObjectReconstruction(
        1,
        OK,
        retrieved=[Retrieved("a <b>mug</b>", 0.4, np.eye(4), np.eye(4), 1.05, weight=0.97)],
        unknown_weight=0.03,
        observed=np.zeros((500, 3), np.float32),
        surface=surface,
    )
    others = [
        ObjectReconstruction(i, TOO_FEW_POINTS, "4 valid depth points") for i in range(2, count + 1)
    ]
    return Reconstruction(
        frame, [found, *others], None, "brrp", "appearance", None, None, {}, 0, "cpu"
    )


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    return open_result(write_made_result(tmp_path_factory.mktemp("printed") / "out"))


@pytest.mark.parametrize("count", [1, 8, 9, 40])
def test_a_result_prints_in_ten_lines_without_arrays(count, stored):
    text = str(result(stored.frame, count))
    lines = text.splitlines()
    assert len(lines) == min(count + 2, 10)
    assert "array" not in text and "[" not in text
    objects = "object" if count == 1 else "objects"
    assert lines[0].startswith(
        f"1 of {count} {objects} of frame.npz; brrp, retrieved by appearance"
    )
    assert lines[2].split() == ["1", "a", "<b>mug</b>", "0.97", "1.05", "1.2", "ok"]
    if count > 8:
        told = sum(line.split()[0].isdecimal() for line in lines[1:])
        assert int(re.search(r"\.\.\. (\d+) more", text)[1]) == count - told


def test_its_parts_print_in_one_line_each(stored):
    item = result(stored.frame, 1).objects[0]
    for part in (item, item.surface, item.retrieved[0], stored.frame, stored):
        assert len(repr(part).splitlines()) == 1 and len(repr(part)) < 200, repr(part)
        assert "array" not in repr(part)


def test_a_notebook_shows_the_masks_and_a_table_of_all(stored):
    shown = result(stored.frame, 12)._repr_html_()
    assert shown.count("<tr>") == 13 and "a &lt;b&gt;mug&lt;/b&gt;" in shown
    picture = re.search(r'src="data:image/jpeg;base64,([^"]+)"', shown)[1]
    size = Image.open(io.BytesIO(base64.b64decode(picture))).size
    assert size == stored.frame.shape[::-1]


def test_a_notebook_shows_the_preview_of_stored_results(stored):
    shown = stored._repr_html_()
    picture = base64.b64decode(re.search(r'src="data:image/png;base64,([^"]+)"', shown)[1])
    assert picture == (stored.folder / "preview.png").read_bytes()
    assert "2 of 3 objects" in shown
