"""Training of the completion that has learned shapes (brrp_cli/completion/shape_network.py).

As for PointSDF, all that is random in a step comes from the seed, the epoch and the step's number;
a checkpoint holds everything else, so that what was interrupted goes on as if it had not been.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import torch
from fit_completion import JITTER, JITTER_WHOLE
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits as cross_entropy

from brrp_cli.completion.network import Network, fitted
from brrp_cli.completion.point_features import WHOLE
from brrp_cli.completion.shape_network import ShapeNetwork, ShapeNetworkConfig
from brrp_cli.files import atomic_path
from brrp_cli.seeds import child_rng, child_seed
from training.checkpoint import (
    CHECKPOINT,
    Progress,
    cooled,
    restore_checkpoint,
    save_checkpoint,
)
from training.completion_examples import Examples

BEST = "best.pt"
# Of the loss of the volume's features alone: the U-Net learns shapes sooner.
ALONE = 0.3
# Between which temperatures the least loss is looked for.
TEMPERATURES = np.geomspace(0.5, 2.0, 57)


@dataclass(frozen=True)
class TrainingConfig:
    """How to train (AdamW, binary cross-entropy).

    batch : objects in a step; points : of each, drawn anew for each step
    cooling : epochs at the end over which the learning rate falls to nothing, by half a cosine;
        warming : steps at the start over which it rises
    """

    epochs: int = 6
    cooling: int = 5
    batch: int = 8
    points: int = 512
    rate: float = 2e-3
    decay: float = 0.02
    warming: int = 100
    seed: int = 0


def started(config: ShapeNetworkConfig, network: Network, seed: int) -> ShapeNetwork:
    """A network that says of a point what `network` says from its lengths, and as yet nearly
    nothing of the volume."""
    torch.manual_seed(child_seed(seed, "network"))
    found = ShapeNetwork(config)
    found.middle.copy_(torch.from_numpy(network.middle))
    found.spread.copy_(torch.from_numpy(network.spread))
    layers = [layer for layer in found.point if isinstance(layer, torch.nn.Linear)]
    with torch.no_grad():
        for layer, (weight, bias) in zip(layers, network.layers, strict=True):
            known = torch.from_numpy(weight.T.copy())
            layer.weight[:, : known.shape[1]] = known
            layer.weight[:, known.shape[1] :] *= 0.1
            layer.bias.copy_(torch.from_numpy(bias))
    return found


class Training:
    """A training in a folder: checkpoint.pt, history.json, and best.pt, the weights of the epoch
    with the least loss on held-out shapes.

    Errors: BrrpError if the folder holds a training with another configuration or a damaged one.
    """

    def __init__(
        self, network: ShapeNetworkConfig, config: TrainingConfig, folder: Path, objects: int
    ) -> None:
        self.config, self.folder, self.objects = config, folder, objects
        # Channels last: a third faster for several objects at once.
        self.network = started(network, fitted(), config.seed).to(
            memory_format=torch.channels_last_3d
        )
        self.optimizer = torch.optim.AdamW(
            self.network.parameters(), config.rate, weight_decay=config.decay
        )
        jitter = torch.full((network.lengths,), JITTER)
        jitter[-WHOLE:] = JITTER_WHOLE
        self.jitter = jitter
        self.progress = Progress()
        if (folder / CHECKPOINT).exists():
            self.progress = restore_checkpoint(folder, self._fixed(), self.network, self.optimizer)

    def run(
        self,
        train: Examples,
        held: Examples,
        *,
        every: int = 100,
        go_on: Callable[[], bool] = lambda: True,
        stepped: Callable[[float], None] = lambda loss: None,
        ended: Callable[[dict[str, float]], None] = lambda record: None,
    ) -> bool:
        """Train to the last epoch; False if `go_on` said to stop before it. Arguments as those of
        PointSDF's training."""
        state = self.progress
        while state.epoch < self.config.epochs:
            start = monotonic()
            batches = self.batches(len(train), state.epoch)
            for step in range(state.step, len(batches)):
                if not go_on():
                    self.save()
                    return False
                self._set_rate(step, len(batches))
                loss = self.step(train, batches[step], step)
                state.losses.append(loss)
                state.step += 1
                stepped(loss)
                if state.step % every == 0:
                    self.save()
            record = {
                "epoch": state.epoch + 1,
                "train_loss": float(np.mean(state.losses)),
                **scores(logits_of(self.network, held, self.config.batch), held),
                "seconds": round(monotonic() - start, 1),
            }
            state.history.append(record)
            state.epoch, state.step, state.losses = state.epoch + 1, 0, []
            if min(state.history, key=lambda each: each["nll"]) is record:
                with atomic_path(self.folder / BEST) as partial:
                    torch.save(self.network.state_dict(), partial)
            self.save()
            ended(record)
        return True

    def best(self, held: Examples) -> ShapeNetwork:
        """The network of the best epoch, its temperature fitted to held-out shapes."""
        found = ShapeNetwork(self.network.config)
        found.load_state_dict(torch.load(self.folder / BEST, weights_only=True))
        found.temperature.fill_(1.0)
        logits = logits_of(found, held, self.config.batch)
        losses = [scores(logits / t, held)["nll"] for t in TEMPERATURES]
        found.temperature.fill_(float(TEMPERATURES[int(np.argmin(losses))]))
        return found.eval().requires_grad_(False)

    def batches(self, count: int, epoch: int) -> list[NDArray[np.int64]]:
        """All examples once, in an order of the epoch's own."""
        order = child_rng(self.config.seed, "order", epoch).permutation(count)
        return np.array_split(order, max(1, count // self.config.batch))

    def step(self, train: Examples, rows: NDArray[np.int64], step: int) -> float:
        """Step number `step` of this epoch, on these objects; gives its loss."""
        rng = child_rng(self.config.seed, "step", self.progress.epoch, step)
        volumes, lengths, places, inside = draw_batch(train, rows, self.config.points, rng)
        torch.manual_seed(child_seed(self.config.seed, "dropout", self.progress.epoch, step))
        network = self.network.train()
        self.optimizer.zero_grad()
        found = network.at(network.encode(volumes), places)
        scaled = network.scaled(lengths)
        logits = network.decide(scaled + self.jitter * torch.randn(scaled.shape), found)
        loss = cross_entropy(logits, inside)
        alone = cross_entropy(network.coarse(found)[..., 0], inside)
        (loss + ALONE * alone).backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        self.optimizer.step()
        return float(loss.detach())

    def _set_rate(self, step: int, steps: int) -> None:
        done = self.progress.epoch * steps + step
        warm = min(1.0, (done + 1) / self.config.warming)
        cool = cooled(done / steps, self.config.epochs, self.config.cooling)
        for group in self.optimizer.param_groups:
            group["lr"] = self.config.rate * warm * cool

    def save(self) -> None:
        """Write checkpoint and history."""
        save_checkpoint(self.folder, self._fixed(), self.network, self.optimizer, self.progress)

    def _fixed(self) -> dict[str, Any]:
        """What a training cannot change on its way: all but when it ends and how it cools."""
        config = asdict(self.config)
        config.pop("epochs")
        config.pop("cooling")
        found = {**config, **asdict(self.network.config), "objects": self.objects}
        return dict(json.loads(json.dumps(found)))


def draw_batch(
    examples: Examples, rows: NDArray[np.int64], points: int, rng: np.random.Generator
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Volumes (B, CHANNELS, n, n, n), lengths (B, Q, 72), places (B, Q, 3), inside (B, Q).

    Every second object is mirrored, left and right: its lengths stay as they are.
    """
    firsts = examples.starts[rows]
    counts = examples.starts[rows + 1] - firsts
    drawn = firsts[:, None] + rng.integers(counts[:, None], size=(len(rows), points))
    volumes = examples.volumes[rows].astype(np.float32) / 127
    places = examples.places[drawn].astype(np.float32)
    mirrored = rng.random(len(rows)) < 0.5
    volumes[mirrored] = volumes[mirrored, :, ::-1]
    places[mirrored, :, 0] *= -1
    return (
        torch.from_numpy(volumes).to(memory_format=torch.channels_last_3d),
        torch.from_numpy(examples.lengths[drawn].astype(np.float32)),
        torch.from_numpy(places),
        torch.from_numpy(examples.inside[drawn].astype(np.float32)),
    )


@torch.no_grad()
def logits_of(network: ShapeNetwork, examples: Examples, batch: int) -> NDArray[np.float64]:
    """Logits (P,) at all points of all examples."""
    network.eval()
    found = []
    for start in range(0, len(examples), batch):
        rows = np.arange(start, min(start + batch, len(examples)))
        volumes = torch.from_numpy(examples.volumes[rows].astype(np.float32) / 127)
        for row, features in zip(rows, network.encode(volumes), strict=True):
            own = slice(examples.starts[row], examples.starts[row + 1])
            places, lengths = (
                torch.from_numpy(array[own].astype(np.float32))
                for array in (examples.places, examples.lengths)
            )
            at = network.at(features[None], places[None])[0]
            found.append(network.decide(network.scaled(lengths), at).numpy())
    return np.concatenate(found).astype(np.float64)


def scores(logits: NDArray[np.floating], examples: Examples) -> dict[str, float]:
    """Over points: mean negative log likelihood. Over objects: mean intersection over union of
    their points, and median volume over true volume."""
    inside = examples.inside
    nll = np.logaddexp(0, np.where(inside, -logits, logits)).mean()
    found = logits > 0
    both, either, true, all_found = (
        np.add.reduceat(each.astype(np.int64), examples.starts[:-1])
        for each in (found & inside, found | inside, inside, found)
    )
    return {
        "nll": float(nll),
        "iou": float(np.mean(both / np.maximum(either, 1))),
        "volume": float(np.median(all_found / np.maximum(true, 1))),
    }
