"""Fit the network that completes objects which no stored one explains (brrp_cli/completion).

    python tools/fit_completion.py SCENES:DATA_ROOT HOUSEHOLD_SCENES:DATA_ROOT:can,bottle,box ...

What the package holds was fitted on three views each of 200 scenes of 50 YCB objects (seed 5000),
100 of 150 household shapes (seed 6000) and 100 of 200 composed solids (seed 6001); the shapes are
those of `tools/export_drawn_shapes.py` with seeds 5000 and 0. Of household shapes it took the kinds
can, bottle, box, apple, banana, ball, hammer and screwdriver: with as many mugs, cups, bowls and
plates as that command draws, most of which fall upside down, a can looks hollow.

Scenes of `tools/make_scenes.py` without noise; three of four views are given the noise of a
structured-light camera, one of four has masks that are shifted by two pixels. A third part takes
only the objects whose names have one of these words. Labels are those of the exact solid. Points
that the frame shows to be empty are not asked. A tenth of the scenes is kept to validate. Writes
brrp_cli/completion/weights.npz.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
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

from brrp_cli.completion.completed_mean import empty_space
from brrp_cli.completion.network import Network
from brrp_cli.completion.point_features import COUNT, WHOLE, point_features
from brrp_cli.completion.visible_part import visible_part
from brrp_cli.config import HypothesesConfig, preset
from brrp_cli.dependencies import import_open3d
from brrp_cli.evaluation.perturb import shift_masks, with_noise
from brrp_cli.geometry import transform_points
from brrp_cli.ground_truth.scenes import Scene, find_scenes
from brrp_cli.ground_truth.truth import TrueObject, true_mesh
from brrp_cli.observation.ray_samples import observe
from brrp_cli.prior.build.repair import repair
from brrp_cli.raycast import raycasting_scene
from brrp_cli.seeds import child_rng

WEIGHTS = Path(__file__).resolve().parents[1] / "brrp_cli" / "completion" / "weights.npz"
# Of an object: around what is seen of it, and far from it, where hypotheses may be.
POINTS, FAR_POINTS = 1500, 100
FAR_MARGIN = 0.2  # metres
HIDDEN = 64
BATCH = 4096
MIN_PIXELS = 100
# Standard deviations of what is added to inputs, in theirs. An object's own features, the same at
# all of its points, would else be learnt by heart.
JITTER, JITTER_WHOLE = 0.03, 0.1


@dataclass(frozen=True)
class Examples:
    """point_features (n, F), inside (n,) of the points of some objects."""

    point_features: NDArray[np.float32]
    inside: NDArray[np.bool_]


@cache
def _hypotheses() -> HypothesesConfig:
    found = preset("default").hypotheses
    assert found is not None
    return found


@cache
def _solid(mesh_path: str, data_root: Path) -> Any:
    """A ray casting scene with the object's closed mesh, metres, in the frame of its file."""
    return raycasting_scene(
        [repair(true_mesh(TrueObject(0, mesh_path, np.eye(4)), data_root)).mesh]
    )


def _inside(points: NDArray[np.floating], solid: Any) -> NDArray[np.bool_]:
    query = import_open3d().core.Tensor(np.ascontiguousarray(points, dtype=np.float32))
    return np.asarray(solid.compute_occupancy(query, nsamples=3).numpy() > 0.5)


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
            frame = shift_masks(frame, 2)
        observed = observe(frame, config.observation, seed)
        assert frame.T_world_cam is not None
        for object_id, observation in observed.objects.items():
            true = scene.object(object_id)
            if (only and not any(word in true.name for word in only)) or len(
                observation.points
            ) < MIN_PIXELS:
                continue
            part = visible_part(
                observation.points, frame, object_id, observed.plane, _hypotheses().completion
            )
            margin = _hypotheses().map.margin
            low, high = part.extent.min(axis=0) - margin, part.extent.max(axis=0) + margin
            points = np.concatenate(
                [
                    rng.uniform(low, high, (POINTS, 3)),
                    rng.uniform(low - FAR_MARGIN, high + FAR_MARGIN, (FAR_POINTS, 3)),
                ]
            )
            asked = ~empty_space(points, frame, object_id, observed.plane, _hypotheses().mean)
            points = points[asked]
            T_object_cam = np.linalg.inv(true.T_world_object) @ frame.T_world_cam
            in_file = transform_points(T_object_cam, points)
            solid = _solid(true.mesh_path, data_root)
            found.append(Examples(point_features(points, part), _inside(in_file, solid)))
    return _together(found)


def _together(found: list[Examples]) -> Examples:
    none = Examples(np.zeros((0, COUNT), dtype=np.float32), np.zeros(0, dtype=bool))
    found = [none, *found]
    return Examples(
        np.concatenate([each.point_features for each in found]),
        np.concatenate([each.inside for each in found]),
    )


def collect(
    folder: Path, data_root: Path, only: tuple[str, ...], views: int, seed: int, workers: int
) -> tuple[Examples, Examples]:
    """To fit on and to validate with: the last tenth of the scenes."""
    scenes = find_scenes(folder)
    job = partial(look, data_root=data_root, only=only, views=views, seed=seed)
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        all_of_them = list(tqdm(pool.map(job, scenes), total=len(scenes), desc=folder.name))
    kept = max(1, len(scenes) // 10)
    return _together(all_of_them[:-kept]), _together(all_of_them[-kept:])


def fit(examples: Examples, held: Examples, epochs: int, seed: int) -> Network:
    """Adam with a rate that falls to zero; binary cross-entropy."""
    generator = torch.Generator().manual_seed(seed)
    torch.manual_seed(seed)
    middle, spread = (
        examples.point_features.mean(axis=0),
        examples.point_features.std(axis=0) + 1e-3,
    )
    x = torch.from_numpy((examples.point_features - middle) / spread)
    y = torch.from_numpy(examples.inside.astype(np.float32))
    net = torch.nn.Sequential(
        torch.nn.Linear(x.shape[1], HIDDEN),
        torch.nn.ReLU(),
        torch.nn.Linear(HIDDEN, HIDDEN),
        torch.nn.ReLU(),
        torch.nn.Linear(HIDDEN, 1),
    )
    jitter = torch.full((x.shape[1],), JITTER)
    jitter[-WHOLE:] = JITTER_WHOLE
    batches = max(1, len(x) // BATCH)
    optimizer = torch.optim.Adam(net.parameters(), lr=3e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, epochs * batches)
    loss_of = torch.nn.functional.binary_cross_entropy_with_logits
    for epoch in range(epochs):
        total = 0.0
        for rows in _batches(len(x), generator):
            optimizer.zero_grad()
            blurred = x[rows] + jitter * torch.randn((len(rows), len(jitter)), generator=generator)
            loss = loss_of(net(blurred)[:, 0], y[rows])
            loss.backward()  # type: ignore[no-untyped-call]
            optimizer.step()
            schedule.step()
            total += float(loss.detach())
        network = _taken(net, middle, spread)
        click.echo(f"epoch {epoch + 1}: {total / batches:.4f}, held {score(network, held)}")
    return _taken(net, middle, spread)


def score(network: Network, examples: Examples) -> str:
    """Mean negative log likelihood and intersection over union of all points."""
    logits = network.logits(examples.point_features).astype(np.float64)
    nll = np.logaddexp(0, np.where(examples.inside, -logits, logits)).mean()
    found = logits > 0
    union = (found | examples.inside).sum()
    return f"NLL {nll:.4f}, IoU {(found & examples.inside).sum() / union:.4f}"


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
@click.option("--views", default=3, show_default=True)
@click.option("--epochs", default=12, show_default=True)
@click.option("--seed", default=0, show_default=True)
@click.option("--workers", default=2, show_default=True)
@click.option("-o", "--output", default=WEIGHTS, type=click.Path(path_type=Path))
def main(
    sets: tuple[str, ...], views: int, epochs: int, seed: int, workers: int, output: Path
) -> None:
    """Fit on SETS, each SCENES:DATA_ROOT or SCENES:DATA_ROOT:WORD,WORD of the objects to take."""
    fitted, held = [], []
    for each in sets:
        folder, root, *words = each.split(":")
        only = tuple(word for part in words for word in part.split(","))
        examples = collect(Path(folder), Path(root), only, views, seed, workers)
        click.echo(
            f"{folder}: {len(examples[0].inside)} points, {examples[0].inside.mean():.3f} inside"
        )
        fitted.append(examples[0])
        held.append(examples[1])
    network = fit(_together(fitted), _together(held), epochs, seed)
    for name, examples in zip(sets, held, strict=True):
        click.echo(f"{name}: {score(network, examples)}")
    output.write_bytes(network.as_bytes())
    click.echo(f"Wrote {output} ({output.stat().st_size} bytes)")


if __name__ == "__main__":
    main()
