"""How far is depth of objects off, as it was measured and as it is used?

    python tools/measure_depth.py SCENES... [--data-root DATA] [--scenes N]

For each set of scenes, in the first view of each, with true masks; depth is held against rays that
are cast into the true meshes. Numbers in millimetres are means of absolute errors, over objects or
over pixels:

smooths   pixels over which the camera mixes low things with the table, median and range over frames
low       objects that are raised for it, and how far their depth is off before and after
mixes     pixels over which it mixes both sides of a jump, median and range
outlines  share of all objects' pixels that are left out for it, how far these are off, and the rest
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message

from brrp_cli.config import HypothesesConfig, preset
from brrp_cli.errors import BrrpError
from brrp_cli.frames.frame import Frame
from brrp_cli.ground_truth.scenes import Scene, find_scenes
from brrp_cli.ground_truth.truth import true_mesh_in_camera
from brrp_cli.methods.scene import image_of
from brrp_cli.observation.strays import without_strays
from brrp_cli.raycast import look

CONFIG = preset("default")
# Pixels of an object that is counted, at least.
LEAST = 50


@dataclass
class Errors:
    """Over the frames of a set. smooths, mixes : pixels; before, after : metres, of low objects;
    left, kept : metres, of pixels"""

    smooths: list[float] = field(default_factory=list)
    mixes: list[float] = field(default_factory=list)
    before: list[float] = field(default_factory=list)
    after: list[float] = field(default_factory=list)
    left: list[NDArray[np.floating]] = field(default_factory=list)
    kept: list[NDArray[np.floating]] = field(default_factory=list)

    def row(self, name: str) -> str:
        """A row of the table."""
        left, kept = np.concatenate(self.left), np.concatenate(self.kept)
        cells = [
            name,
            _range(self.smooths),
            f"{len(self.before)}, {_mean(self.before)} to {_mean(self.after)} mm",
            _range(self.mixes),
            f"{len(left) / max(1, len(left) + len(kept)):.1%}, {_mean(left)} and {_mean(kept)} mm",
        ]
        return "| " + " | ".join(cells) + " |"


def add(errors: Errors, scene: Scene, data_root: Path | None) -> None:
    """What the first view of a scene tells."""
    hypotheses = CONFIG.hypotheses
    assert isinstance(hypotheses, HypothesesConfig)
    frame = without_strays(scene.view(0), CONFIG.strays)
    if frame.T_world_cam is None:
        raise BrrpError("A view has no pose", where=scene.folder)
    image = image_of(frame, hypotheses, CONFIG.observation, 0)
    mended = image.mended(frame, hypotheses)
    left = frame.valid & ~image.clear(mended, hypotheses).valid
    errors.smooths.append(image.smoothing)
    errors.mixes.append(image.mixing)
    meshes = [true_mesh_in_camera(each, data_root, frame.T_world_cam) for each in scene.objects]
    sight = look(meshes, frame.K, frame.shape)
    for number, each in enumerate(scene.objects):
        own = frame.valid & (frame.segmap == each.id) & (sight.index == number)
        if np.count_nonzero(own) < LEAST:
            continue
        off, after = (_off(f, own, sight.depth) for f in (frame, mended))
        if (off != after).any():
            errors.before.append(float(off.mean()))
            errors.after.append(float(after.mean()))
        errors.left.append(after[left[own]])
        errors.kept.append(after[~left[own]])


def _off(frame: Frame, own: NDArray[np.bool_], depth: NDArray[np.floating]) -> NDArray[np.floating]:
    return np.abs(frame.depth[own] - depth[own])


def _range(values: list[float]) -> str:
    low, middle, high = np.quantile(values, [0, 0.5, 1])
    return f"{middle:g} ({low:g} to {high:g})"


def _mean(metres: list[float] | NDArray[np.floating]) -> str:
    return f"{1000 * np.mean(metres):.1f}" if len(metres) else "-"


@one_message()
def main() -> None:
    """See the top of the file."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("sets", nargs="+", type=Path, metavar="SCENES")
    parser.add_argument("--data-root", type=Path)
    parser.add_argument("--scenes", type=int, default=None, help="of each set, the first N")
    given = parser.parse_args()
    print("| | smooths, px | low: off before, after | mixes, px | outlines: off, the rest |")
    print("| --- | --- | --- | --- | --- |")
    for folder in given.sets:
        errors = Errors()
        for scene in find_scenes(folder)[: given.scenes]:
            add(errors, scene, given.data_root)
        print(errors.row(folder.name), flush=True)


if __name__ == "__main__":
    main()
