"""Examples of objects that are to be completed, made from scenes once and kept as .npz.

One file for each view of a scene, SET/NAME_VIEW.npz, of its N objects:

    volumes   (N, CHANNELS, n, n, n) int8, of brrp_cli/completion/volume.py
    lengths   (P, 72) float16, of point_features.py, at all points of all objects
    places    (P, 3) float16, of the points, in the volumes
    inside    (P,) bool, in the exact mesh
    counts    (N,) points of each object; names (N,)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path

import numpy as np
from fit_completion import asked_points, clouds_and_plane, is_inside, solid_of
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from brrp_cli.completion.completed_mean import empty_space
from brrp_cli.completion.point_features import COUNT, point_features
from brrp_cli.completion.usual_size import resized
from brrp_cli.completion.visible_part import visible_part
from brrp_cli.completion.volume import CHANNELS, volume_of
from brrp_cli.config import HypothesesConfig, preset
from brrp_cli.depth_noise.registry import VIEW_SENSORS
from brrp_cli.depth_noise.view import View
from brrp_cli.evaluation.perturb import shift_masks, with_noise
from brrp_cli.files import write_bytes
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.geometry import backproject, normalise, transform_points
from brrp_cli.ground_truth.scenes import Scene
from brrp_cli.seeds import child_rng

# What the frame of a scene without noise is seen through, and how often.
SENSORS = {"none": 0.1, "structured-light": 0.45, "xtion": 0.35, "kinect-azure": 0.1}
ALBEDO = (0.2, 0.9)  # of everything in the frame, what it shows to an infrared camera
# Masks as they are, moved aside or grown, and by how many pixels.
SHIFTED, GROWN, PIXELS = 0.15, 0.15, 2
DRAWS = 2  # of the points that an object is asked at
# A camera cannot tell a large thing far away from a small one near: how many are looked at as if
# all lengths were others, and how many times.
RESIZED, TIMES = 0.5, (0.6, 1.8)
# What a stretched shape's name adds to that of the shape.
STRETCHED = "~"


@dataclass(frozen=True)
class Examples:
    """As the files hold them; starts (N + 1,) of the objects' points."""

    volumes: NDArray[np.int8]
    lengths: NDArray[np.float16]
    places: NDArray[np.float16]
    inside: NDArray[np.bool_]
    starts: NDArray[np.int64]
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.volumes)


@dataclass(frozen=True)
class Wanted:
    """A view of a scene, where its meshes are, and whether its depth is a camera's already."""

    scene: Scene
    view: int
    data_root: Path
    measured: bool = False

    @property
    def name(self) -> str:
        """The examples' file, in the folder of all."""
        return f"{self.scene.folder.parent.name}/{self.scene.name}_{self.view}.npz"


def make_view(wanted: Wanted, seed: int, path: Path) -> None:
    """Write the examples of a view, whole or not at all."""
    scene = wanted.scene
    rng = child_rng(seed, scene.folder.parent.name, scene.name, wanted.view)
    frame = scene.view(wanted.view)
    frame = _worse_masks(frame if wanted.measured else through_a_sensor(frame, rng), rng)
    write_bytes(path, _as_bytes(view_examples(scene, frame, wanted.data_root, seed, rng)))


def view_examples(
    scene: Scene, frame: Frame, data_root: Path, seed: int, rng: np.random.Generator
) -> list[
    tuple[NDArray[np.int8], NDArray[np.float16], NDArray[np.float16], NDArray[np.bool_], str]
]:
    """Volume, lengths, places, inside and name of each object of `frame` that can be used."""
    config = preset("default")
    hypotheses = config.hypotheses
    assert hypotheses is not None
    T_world_cam = frame.T_world_cam
    assert T_world_cam is not None
    clouds, plane = clouds_and_plane(frame, config.observation, seed)
    found = []
    for object_id, cloud in clouds.items():
        true = scene.object(object_id)
        solid = solid_of(true.mesh_path, data_root)
        if solid is None:
            continue
        part, times = visible_part(cloud, frame, object_id, plane, hypotheses.completion), 1.0
        if rng.random() < RESIZED:
            times = float(np.exp(rng.uniform(*np.log(TIMES))))
            part = resized(part, times)
        points = np.concatenate([asked_points(part, rng) for _ in range(DRAWS)])
        points = points[~empty_space(points, part.frame, object_id, part.plane, hypotheses.mean)]
        if not len(points):
            continue
        volume = volume_of(part, hypotheses.completion.volume)
        T_file_cam = np.linalg.inv(true.T_world_object) @ T_world_cam
        in_file = transform_points(T_file_cam, points / times)
        found.append(
            (
                volume.values,
                point_features(points, part).astype(np.float16),
                np.clip(volume.places(points), -4, 4).astype(np.float16),
                is_inside(in_file, solid),
                true.name,
            )
        )
    return found


def through_a_sensor(frame: Frame, rng: np.random.Generator) -> Frame:
    """The frame as one of `SENSORS` would have seen it."""
    name = str(rng.choice([*SENSORS], p=[*SENSORS.values()]))
    if name == "none":
        return frame
    if name == "structured-light":
        return with_noise(frame, rng)
    depth = np.where(frame.valid, frame.points[..., 2], 0.0)
    albedo = np.full(depth.shape, rng.uniform(*ALBEDO))
    view = View(depth, frame.K, _normals(depth, frame), albedo, np.zeros(depth.shape))
    measured = VIEW_SENSORS[name].measure(view, rng)
    return replace(frame, points=backproject(measured, frame.K))


def _normals(depth: NDArray[np.float64], frame: Frame) -> NDArray[np.float64]:
    points = backproject(depth, frame.K)
    down, right = np.gradient(np.nan_to_num(points), axis=(0, 1))
    return normalise(np.cross(right, down) + np.array([0, 0, 1e-12]))


def _worse_masks(frame: Frame, rng: np.random.Generator) -> Frame:
    kind, pixels = rng.random(), int(rng.integers(1, PIXELS + 1))
    if kind < SHIFTED:
        return shift_masks(frame, int(rng.choice([-1, 1])) * pixels)
    if kind > SHIFTED + GROWN:
        return frame
    segmap = frame.segmap.copy()
    for object_id in frame.object_ids:
        grown = binary_dilation(frame.segmap == object_id, iterations=pixels)
        segmap[grown & (frame.segmap == BACKGROUND)] = object_id
    return replace(frame, segmap=segmap)


def _as_bytes(found: list) -> bytes:
    side = _side()
    buffer = BytesIO()
    np.savez_compressed(
        buffer,
        volumes=np.array([each[0] for each in found], np.int8).reshape(-1, CHANNELS, *(side,) * 3),
        lengths=np.concatenate([np.zeros((0, COUNT), np.float16), *(each[1] for each in found)]),
        places=np.concatenate([np.zeros((0, 3), np.float16), *(each[2] for each in found)]),
        inside=np.concatenate([np.zeros(0, bool), *(each[3] for each in found)]),
        counts=np.array([len(each[3]) for each in found], np.int64),
        names=np.array([each[4] for each in found], "U"),
    )
    return buffer.getvalue()


def _side() -> int:
    return HypothesesConfig().completion.volume.side


def names_in(paths: Sequence[Path]) -> list[str]:
    """Names of the objects of all files, one after the other."""
    found = []
    for path in paths:
        with np.load(path, allow_pickle=False) as file:
            found += [str(name) for name in file["names"]]
    return found


def read_examples(
    paths: Sequence[Path], wanted: Callable[[str], bool] = lambda name: True
) -> Examples:
    """The examples of all files, one after the other, of objects whose name is `wanted`: in place,
    since they may fill half of the memory."""
    names, counts = [], []
    for path in paths:
        with np.load(path, allow_pickle=False) as file:
            mine = [bool(wanted(str(name))) for name in file["names"]]
            names += [str(name) for name in file["names"][mine]]
            counts += file["counts"][mine].tolist()
    starts = np.concatenate([np.zeros(1, np.int64), np.cumsum(counts, dtype=np.int64)])
    side, points = _side(), int(starts[-1])
    found = Examples(
        np.empty((len(names), CHANNELS, side, side, side), np.int8),
        np.empty((points, COUNT), np.float16),
        np.empty((points, 3), np.float16),
        np.empty(points, bool),
        starts,
        tuple(names),
    )
    objects = begin = 0
    for path in paths:
        with np.load(path, allow_pickle=False) as file:
            mine = np.array([bool(wanted(str(name))) for name in file["names"]], dtype=bool)
            of_mine = np.repeat(mine, file["counts"])
            found.volumes[objects : objects + mine.sum()] = file["volumes"][mine]
            own = slice(begin, begin + int(of_mine.sum()))
            found.lengths[own] = file["lengths"][of_mine]
            found.places[own] = file["places"][of_mine]
            found.inside[own] = file["inside"][of_mine]
            objects, begin = objects + int(mine.sum()), own.stop
    return found


def make_all(every: Sequence[Wanted], seed: int, folder: Path) -> Iterator[Path]:
    """Write what is missing of the examples of these views into `folder`, all first views first;
    yields each one's file."""
    for wanted in sorted(every, key=lambda each: (each.view, each.scene.name)):
        path = folder / wanted.name
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            make_view(wanted, seed, path)
        yield path


def held_names(names: Sequence[str], share: float, seed: int) -> frozenset[str]:
    """Shapes that are kept to validate: whether one is depends on its name and the seed alone. A
    stretched shape is kept when the shape is."""

    def kept(name: str) -> bool:
        shape = name.partition(STRETCHED)[0]
        return bool(child_rng(seed, "validation", shape).random() < share)

    return frozenset(name for name in set(names) if kept(name))
