"""Where do walls of bins and shelves, and platforms, seem to be, and do hands keep out of them?

    python tools/measure_furniture.py SCENES... [--prior PRIOR] [--scenes N]

For each set of scenes that `tools/make_scenes.py` wrote with `--bin`, `--platform` or `--shelf`, in
the first view of each; true masks tell what the objects stand on:

bins     platforms or shelves: scenes in which one is found
walls    walls, boards above and platforms that have a model, of those of which the image shows most
         (what is in front of them does not count)
off      median and 90 % of how far models lie from the true walls: of a bin at the rim and at the
         foot, of a shelf the face that is seen, of a platform its upper face
false    models, of all, of which a part is more than 3 cm from any true wall; they are not in `off`

With --prior, objects are reconstructed from true masks and grasps are planned (default hand):

grasps   hands that have a part of a true wall in them, open, on their way in or at its end
best     objects whose best grasp is such a one
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import trimesh

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message
from tabletop.furniture import read_walls

from brrp_cli.config import ObservationConfig
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.errors import BrrpError
from brrp_cli.geometry import transform_points
from brrp_cli.grasping.grasp import GraspPlan
from brrp_cli.grasping.plan import plan_grasps
from brrp_cli.ground_truth.scenes import Scene, find_scenes
from brrp_cli.observation.ray_samples import scene_plane
from brrp_cli.prior.store import open_prior
from brrp_cli.raycast import raycasting_scene
from brrp_cli.segmentation.bin_walls import Solid
from brrp_cli.segmentation.furniture import furniture
from brrp_cli.session import Reconstructor

FALSE = 0.03
STEPS = 9
KINDS = {"bin": "bins", "platform": "platforms", "shelf": "shelves"}
# Points on each true wall, against which hands are held.
POINTS = 4_000


@dataclass
class Found:
    """Counts over scenes; off : metres, of all faces of all walls."""

    kind: str = "bin"
    scenes: int = 0
    found: int = 0
    shown: int = 0
    modelled: int = 0
    models: int = 0
    false: int = 0
    off: list[float] = field(default_factory=list)
    grasps: int = 0
    swept: int = 0
    best: int = 0
    best_swept: int = 0


def bin_points(wall: Solid) -> np.ndarray:
    """Points (n, 3) of the middle of a wall, at its rim and its foot, without its ends."""
    share = np.linspace(0, 1, STEPS)[1:-1, None]
    rim, foot = wall[:4].reshape(2, 2, 3).mean(axis=0), wall[4:].reshape(2, 2, 3).mean(axis=0)
    return np.concatenate([(1 - share) * end[0] + share * end[1] for end in (rim, foot)])


def face_points(slab: Solid) -> np.ndarray:
    """Points (n, 3) of the face of a slab, without its ends."""
    face, _ = np.split(slab, 2)
    middle = face.mean(axis=0)
    return np.concatenate([middle[None], middle + 0.8 * (face - middle)])


def measure_walls(scene: Scene, walls: list[trimesh.Trimesh], found: Found) -> None:
    """Add how far models lie from the true walls, meshes in the camera frame."""
    frame = scene.view(0)
    around = furniture(frame, scene_plane(frame, ObservationConfig(), 0), 0, SegmentConfig())
    models = [bin_points(wall) for each in around.bins for wall in each]
    models += [face_points(slab) for slab in (*around.walls, *around.platforms)]
    found.scenes += 1
    found.found += bool(models)
    own = set()
    for model in models:
        points = model.astype(np.float32)
        distances = [raycasting_scene([wall]).compute_distance(points).numpy() for wall in walls]
        off = np.min(distances, axis=0)
        if off.max() > FALSE:
            found.false += 1
            continue
        found.off += off.tolist()
        own.add(int(np.mean(distances, axis=1).argmin()))
    found.models += len(models)
    shown = {i for i, wall in enumerate(walls) if in_view(wall, frame.K, frame.shape)}
    found.shown, found.modelled = found.shown + len(shown), found.modelled + len(shown & own)


def in_view(wall: trimesh.Trimesh, K: np.ndarray, shape: tuple[int, int]) -> bool:
    """Whether most of a wall, camera frame, projects into an image of this shape."""
    pixels = wall.sample(200, seed=0) @ K.T
    x, y = (pixels[:, :2] / pixels[:, 2:]).T
    return bool(((x > 0) & (x < shape[1]) & (y > 0) & (y < shape[0])).mean() > 0.5)


def count_grasps(plan: GraspPlan, points: np.ndarray, found: Found) -> None:
    """Add the hands that sweep points (n, 3), camera frame."""
    for item in plan.objects:
        for rank, grasp in enumerate(item.grasps):
            local = transform_points(np.linalg.inv(grasp.T_cam_gripper), points)
            opening = np.array([grasp.opening])
            boxes = plan.gripper.boxes(opening, plan.config.approach)[0]
            inside = (local[None] >= boxes[:, None, 0]) & (local[None] <= boxes[:, None, 1])
            swept = bool(inside.all(axis=-1).any())
            found.grasps, found.swept = found.grasps + 1, found.swept + swept
            if rank == 0:
                found.best, found.best_swept = found.best + 1, found.best_swept + swept


def line(name: str, found: Found, planned: bool) -> str:
    """What is printed of a set."""
    off = 1000 * np.quantile(found.off, [0.5, 0.9]) if found.off else [np.nan] * 2
    text = (
        f"{name}: {KINDS[found.kind]} {found.found}/{found.scenes},"
        f" walls {found.modelled}/{found.shown},"
        f" off {off[0]:.1f} mm (90 %: {off[1]:.1f}), false {found.false}/{found.models}"
    )
    if planned:
        text += f", grasps {found.swept}/{found.grasps}, best {found.best_swept}/{found.best}"
    return text


@one_message()
def main() -> None:
    """See the top of the file."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("sets", nargs="+", type=Path, metavar="SCENES")
    parser.add_argument("--prior", type=Path)
    parser.add_argument("--scenes", type=int, default=None, help="of each set, the first N")
    options = parser.parse_args()
    again = None if options.prior is None else Reconstructor(open_prior(options.prior))
    for folder in options.sets:
        found = Found()
        for scene in find_scenes(folder)[: options.scenes]:
            frame = scene.view(0)
            if frame.T_world_cam is None:
                raise BrrpError("A view has no pose", where=scene.folder)
            T_cam_world = np.linalg.inv(frame.T_world_cam)
            found.kind, walls = read_walls(scene.folder)
            walls = [wall.apply_transform(T_cam_world) for wall in walls]
            measure_walls(scene, walls, found)
            if again is not None:
                points = np.concatenate([wall.sample(POINTS, seed=0) for wall in walls])
                count_grasps(plan_grasps(again(frame)), points, found)
        print(line(folder.name, found, again is not None), flush=True)


if __name__ == "__main__":
    main()
