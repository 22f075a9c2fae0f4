"""Fit the network that completes objects which no stored one explains (brrp_cli/completion).

    python tools/fit_completion.py --examples examples SCENES:DATA_ROOT ...

SCENES of `tools/make_scenes.py` without noise; of four scenes three are given the noise of a
structured-light camera, and one of those three has masks that are shifted by a pixel or two. A
third part, SCENES:DATA_ROOT:can,bottle, takes only the objects whose names have one of these words.
A point counts as inside when it is inside the exact mesh. Points that the frame shows to be empty
are not asked. A tenth of the scenes is kept to validate. With `--examples`, what a scene gives
is kept in that folder, and not made again. Writes brrp_cli/completion/weights.npz.

What the package holds was fitted on these scenes (`ycb` as in tools/make_scenes.py, `objects` the
household objects of data_manifests/household_held_out.toml):

    python tools/make_scenes.py --meshes objects --held-out leave --scenes 110 --seed 15000 -o house
    python tools/export_drawn_shapes.py --count 150 --seed 15001 -o drawn_shapes
    python tools/make_scenes.py --meshes drawn_shapes --scenes 50 --seed 15001 -o drawn
    python tools/make_scenes.py --meshes ycb --skip $UNSEEN --scenes 60 --seed 15002 -o ycb_scenes
    python tools/export_random_shapes.py --first 300 --count 120 -o random_shapes
    python tools/make_scenes.py --meshes random_shapes --scenes 35 --seed 15003 -o random
    python tools/export_drawn_shapes.py --kind composed --count 120 --seed 15004 -o composed_shapes
    python tools/make_scenes.py --meshes composed_shapes --scenes 25 --seed 15004 -o composed
    python tools/fit_completion.py house:. drawn:. ycb_scenes:. random:. composed:.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from io import BytesIO
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import click
import numpy as np
import torch
from numpy.typing import NDArray
from tqdm import tqdm

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message

from brrp_cli.completion.completed_mean import empty_space
from brrp_cli.completion.network import Network
from brrp_cli.completion.point_features import COUNT, WHOLE, point_features
from brrp_cli.completion.visible_part import VisiblePart, visible_part
from brrp_cli.config import HypothesesConfig, ObservationConfig, preset
from brrp_cli.dependencies import import_open3d
from brrp_cli.errors import MeshError
from brrp_cli.evaluation.perturb import shift_masks, with_noise
from brrp_cli.files import write_bytes
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.geometry import normalise, transform_points
from brrp_cli.ground_truth.scenes import Scene, find_scenes
from brrp_cli.ground_truth.truth import TrueObject, true_mesh
from brrp_cli.observation.ray_samples import box_center
from brrp_cli.observation.support_plane import Plane, fit_plane
from brrp_cli.prior.build.repair import repair
from brrp_cli.raycast import raycasting_scene
from brrp_cli.seeds import child_rng

WEIGHTS = Path(__file__).resolve().parents[1] / "brrp_cli" / "completion" / "weights.npz"
# Of an object: in the box around it, near what is seen of it, and far from it, where hypotheses may
# be. What is asked depends on what is seen alone, never on the truth: the odds stay honest.
POINTS, NEAR_POINTS, FAR_POINTS = 700, 700, 100
FAR_MARGIN = 0.2  # metres
# How far from seen points: this share of the object's size, and metres.
NEAR_SHARE, NEAR = 0.12, 0.003
HIDDEN = 128
BATCH = 4096
MIN_PIXELS = 100
# Standard deviations of what is added to inputs, in theirs. An object's own features, the same at
# all of its points, would else be learnt by heart.
JITTER, JITTER_WHOLE = 0.1, 0.4
DROPOUT, DECAY, RATE = 0.1, 0.05, 2e-3


@dataclass(frozen=True)
class Examples:
    """point_features (n, F), inside (n,) of the points of some objects."""

    point_features: NDArray[np.floating]
    inside: NDArray[np.bool_]


@cache
def _hypotheses() -> HypothesesConfig:
    found = preset("default").hypotheses
    assert found is not None
    return found


# Open3D ends the process where more than a thousand scenes are kept.
@lru_cache(maxsize=256)
def solid_of(mesh_path: str, data_root: Path) -> Any:
    """A ray casting scene with the object's closed mesh, metres, in the frame of its file; None for
    a mesh that cannot be closed."""
    try:
        mesh = repair(true_mesh(TrueObject(0, mesh_path, np.eye(4)), data_root)).mesh
    except MeshError as error:
        click.echo(f"{mesh_path}: left out: {error}")
        return None
    return raycasting_scene([mesh])


def is_inside(points: NDArray[np.floating], solid: Any) -> NDArray[np.bool_]:
    """Which of points (n, 3), in the frame of the mesh's file, lie in it."""
    query = import_open3d().core.Tensor(np.ascontiguousarray(points, dtype=np.float32))
    return np.asarray(solid.compute_occupancy(query, nsamples=3).numpy() > 0.5)


def clouds_and_plane(
    frame: Frame, config: ObservationConfig, seed: int
) -> tuple[dict[int, NDArray[np.float32]], Plane | None]:
    """Points (n, 3), metres, camera frame, of each object with `MIN_PIXELS` of them, by id, and
    the plane beneath these."""
    clouds = {i: frame.object_points(i) for i in frame.object_ids}
    clouds = {i: points for i, points in clouds.items() if len(points) >= MIN_PIXELS}
    if not clouds:
        return {}, None
    middle = np.mean([box_center(points) for points in clouds.values()], axis=0)
    ground = frame.points[frame.valid & (frame.segmap == BACKGROUND)]
    return clouds, fit_plane(ground, config, seed, middle)


def look(scene: Scene, data_root: Path, only: tuple[str, ...], views: int, seed: int) -> Examples:
    """The examples of a scene's first views."""
    config = preset("default")
    found: list[Examples] = []
    for view in range(min(views, len(scene.views))):
        number = int(scene.name) + view
        rng = child_rng(seed, scene.name, view)
        frame = scene.view(view)
        if number % 4:
            frame = with_noise(frame, rng)
        if number % 4 == 3:
            frame = shift_masks(frame, int(rng.choice([-2, -1, 1, 2])))
        T_world_cam = frame.T_world_cam
        assert T_world_cam is not None
        clouds, plane = clouds_and_plane(frame, config.observation, seed)
        for object_id, cloud in clouds.items():
            true = scene.object(object_id)
            solid = solid_of(true.mesh_path, data_root)
            if solid is None or (only and not any(word in true.name for word in only)):
                continue
            part = visible_part(cloud, frame, object_id, plane, _hypotheses().completion)
            points = asked_points(part, rng)
            points = points[~empty_space(points, frame, object_id, plane, _hypotheses().mean)]
            in_file = transform_points(np.linalg.inv(true.T_world_object) @ T_world_cam, points)
            found.append(
                Examples(point_features(points, part).astype(np.float16), is_inside(in_file, solid))
            )
    return _together(found)


def asked_points(part: VisiblePart, rng: np.random.Generator) -> NDArray[np.float64]:
    """Points (n, 3), metres, camera frame, at which an object is looked at."""
    margin = _hypotheses().map.margin
    low, high = part.extent.min(axis=0) - margin, part.extent.max(axis=0) + margin
    seen = part.seen[rng.integers(len(part.seen), size=NEAR_POINTS)]
    spread = NEAR + NEAR_SHARE * part.size
    behind = np.abs(rng.normal(0, spread, (NEAR_POINTS, 1)))
    around = rng.normal(0, spread / 3, (NEAR_POINTS, 3))
    return np.concatenate(
        [
            rng.uniform(low, high, (POINTS, 3)),
            seen + behind * normalise(seen) + around,
            rng.uniform(low - FAR_MARGIN, high + FAR_MARGIN, (FAR_POINTS, 3)),
        ]
    )


def _together(found: list[Examples]) -> Examples:
    none = Examples(np.zeros((0, COUNT), dtype=np.float16), np.zeros(0, dtype=bool))
    found = [none, *found]
    return Examples(
        np.concatenate([each.point_features for each in found]),
        np.concatenate([each.inside for each in found]),
    )


def kept_look(scene: Scene, folder: Path | None, options: dict[str, Any]) -> Examples:
    """As `look`, kept in `folder`."""
    path = None if folder is None else folder / f"{scene.name}.npz"
    if path is not None and path.exists():
        with np.load(path) as arrays:
            return Examples(arrays["point_features"], arrays["inside"])
    found = look(scene, **options)
    if path is not None:
        buffer = BytesIO()
        np.savez(buffer, point_features=found.point_features, inside=found.inside)
        write_bytes(path, buffer.getvalue())
    return found


def collect(
    folder: Path, keep: Path | None, workers: int, **options: Any
) -> tuple[Examples, Examples]:
    """To fit on and to validate with: the last tenth of the scenes. `options` are `look`'s."""
    scenes = find_scenes(folder)
    kept = None if keep is None else keep / folder.name
    job = partial(kept_look, folder=kept, options=options)
    if workers == 1:
        all_of_them = [job(scene) for scene in tqdm(scenes, desc=folder.name)]
    else:
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
            all_of_them = list(tqdm(pool.map(job, scenes), total=len(scenes), desc=folder.name))
    last = max(1, len(scenes) // 10)
    return _together(all_of_them[:-last]), _together(all_of_them[-last:])


def fit(examples: Examples, held: Examples, epochs: int, seed: int) -> Network:
    """AdamW with a rate that falls to zero; binary cross-entropy."""
    generator = torch.Generator().manual_seed(seed)
    torch.manual_seed(seed)
    middle = examples.point_features.mean(axis=0, dtype=np.float32)
    spread = examples.point_features.std(axis=0, dtype=np.float32) + np.float32(1e-3)
    x = torch.from_numpy(examples.point_features)
    scaling = torch.from_numpy(middle), torch.from_numpy(spread)
    y = torch.from_numpy(examples.inside.astype(np.float32))
    net = torch.nn.Sequential(
        torch.nn.Linear(x.shape[1], HIDDEN),
        torch.nn.ReLU(),
        torch.nn.Dropout(DROPOUT),
        torch.nn.Linear(HIDDEN, HIDDEN),
        torch.nn.ReLU(),
        torch.nn.Dropout(DROPOUT),
        torch.nn.Linear(HIDDEN, 1),
    )
    jitter = torch.full((x.shape[1],), JITTER)
    jitter[-WHOLE:] = JITTER_WHOLE
    batches = max(1, len(x) // BATCH)
    optimizer = torch.optim.AdamW(net.parameters(), lr=RATE, weight_decay=DECAY)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, epochs * batches)
    loss_of = torch.nn.functional.binary_cross_entropy_with_logits
    for epoch in range(epochs):
        total = 0.0
        for rows in _batches(len(x), generator):
            optimizer.zero_grad()
            scaled = (x[rows].float() - scaling[0]) / scaling[1]
            blurred = scaled + jitter * torch.randn((len(rows), len(jitter)), generator=generator)
            loss = loss_of(net(blurred)[:, 0], y[rows])
            loss.backward()
            optimizer.step()
            schedule.step()
            total += float(loss.detach())
        network = _taken(net, middle, spread)
        click.echo(f"epoch {epoch + 1}: {total / batches:.4f}, held {score(network, held)}")
    return _taken(net, middle, spread)


def score(network: Network, examples: Examples) -> str:
    """Mean negative log likelihood and intersection over union of all points."""
    logits = network.logits(examples.point_features.astype(np.float32)).astype(np.float64)
    nll = np.logaddexp(0, np.where(examples.inside, -logits, logits)).mean()
    found = logits > 0
    union = (found | examples.inside).sum()
    iou = (found & examples.inside).sum() / max(1, union)
    volume = found.sum() / max(1, examples.inside.sum())
    return f"NLL {nll:.4f}, IoU {iou:.4f}, volume {volume:.3f}"


def _batches(count: int, generator: torch.Generator) -> Iterator[torch.Tensor]:
    order = torch.randperm(count, generator=generator)
    for start in range(0, max(1, count - BATCH + 1), BATCH):
        yield order[start : start + BATCH]


def _taken(
    net: torch.nn.Sequential, middle: NDArray[np.float32], spread: NDArray[np.float32]
) -> Network:
    layers = tuple(
        (layer.weight.detach().numpy().T.copy(), layer.bias.detach().numpy().copy())
        for layer in net
        if isinstance(layer, torch.nn.Linear)
    )
    return Network(middle.astype(np.float32), spread.astype(np.float32), layers)


@click.command()
@click.argument("sets", nargs=-1, required=True)
@click.option("--views", default=1, show_default=True)
@click.option("--epochs", default=7, show_default=True)
@click.option("--seed", default=0, show_default=True)
@click.option("--workers", default=2, show_default=True)
@click.option("--examples", type=click.Path(path_type=Path), help="Folder to keep examples in.")
@click.option("-o", "--output", default=WEIGHTS, type=click.Path(path_type=Path))
@one_message()
def main(
    sets: tuple[str, ...],
    views: int,
    epochs: int,
    seed: int,
    workers: int,
    examples: Path | None,
    output: Path,
) -> None:
    """Fit on SETS, each SCENES:DATA_ROOT or SCENES:DATA_ROOT:WORD,WORD of the objects to take."""
    fitted, held = [], []
    for each in sets:
        folder, root, *words = each.split(":")
        only = tuple(word for part in words for word in part.split(","))
        one, other = collect(
            Path(folder),
            examples,
            workers,
            data_root=Path(root),
            only=only,
            views=views,
            seed=seed,
        )
        click.echo(f"{folder}: {len(one.inside)} points, {one.inside.mean():.3f} inside")
        fitted.append(one)
        held.append(other)
    network = fit(_together(fitted), _together(held), epochs, seed)
    for name, kept in zip(sets, held, strict=True):
        click.echo(f"{name}: {score(network, kept)}")
    output.write_bytes(network.as_bytes())
    click.echo(f"Wrote {output} ({output.stat().st_size} bytes)")


if __name__ == "__main__":
    main()
