"""Training of PointSDF: epochs over examples, checkpoints, and the same losses after a kill.

All that is random in a step comes from the seed, the epoch and the step's number alone. A
checkpoint holds everything else that a step depends on, so that a training that was interrupted
goes on as if it had not been (on the CPU to the last bit; CUDA adds in no fixed order).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from brrp_cli.methods.pointsdf.network import NetworkConfig, PointSDF
from brrp_cli.methods.pointsdf.weights import save_weights
from brrp_cli.seeds import child_rng, child_seed
from training.checkpoint import (
    CHECKPOINT,
    Progress,
    cooled,
    restore_checkpoint,
    save_checkpoint,
)
from training.examples import Examples

LEVEL = 0.3
SETTLING = 32  # batches


@dataclass(frozen=True)
class TrainingConfig:
    """How to train (Adam, binary cross-entropy).

    batch : objects in a step; queries : of each, drawn anew for each step
    noise : metres, standard deviation of each coordinate of a cloud's points
    precision : "float32" or "bfloat16", of the products; weights are float32 either way
    cooling : epochs at the end over which the learning rate falls to nothing, by half a cosine
    """

    epochs: int = 50
    batch: int = 16
    queries: int = 512
    noise: float = 0.002
    learning_rate: float = 1e-3
    precision: str = "float32"
    seed: int = 0
    cooling: int = 0


def narrowed(config: NetworkConfig, width: float) -> NetworkConfig:
    """`config` with `width` times as many features in every layer but the two codes."""

    def fewer(count: int) -> int:
        return max(8, round(count * width))

    features = tuple(tuple(fewer(n) for n in layer) for layer in config.features)
    return replace(config, features=features, hidden=fewer(config.hidden))


class Training:
    """A training in a folder: checkpoint.pt, history.json, and `weights` of its best epoch.

    about : what the weights' file is to say of the examples, plain JSON; device : torch's name
    Errors: BrrpError if the folder holds a training with another configuration or a damaged one.
    """

    def __init__(
        self,
        network: NetworkConfig,
        config: TrainingConfig,
        folder: Path,
        weights: Path,
        about: dict[str, Any],
        device: str = "cpu",
    ) -> None:
        torch.manual_seed(child_seed(config.seed, "network"))
        self.config, self.folder, self.weights, self.about = config, folder, weights, about
        self.device = device
        self.network = PointSDF(network).to(device)
        self.optimizer = torch.optim.Adam(self.network.parameters(), config.learning_rate)
        self.progress = Progress()
        if (folder / CHECKPOINT).exists():
            self.progress = restore_checkpoint(
                folder, self._fixed(), self.network, self.optimizer, self.device
            )

    def run(
        self,
        train: Examples,
        validation: Examples,
        *,
        every: int = 200,
        go_on: Callable[[], bool] = lambda: True,
        stepped: Callable[[float], None] = lambda loss: None,
        ended: Callable[[dict[str, float]], None] = lambda record: None,
    ) -> bool:
        """Train to the last epoch; False if `go_on` said to stop before it.

        every : steps between checkpoints, beside the one after each epoch; stepped : told the loss
        of each step; ended : told the record of each epoch
        """
        state = self.progress
        while state.epoch < self.config.epochs:
            start = monotonic()
            batches = self.batches(len(train), state.epoch)
            for step in range(state.step, len(batches)):
                if not go_on():
                    self.save()
                    return False
                self.set_rate(state.epoch + step / len(batches))
                loss = self.step(train, batches[step], step)
                state.losses.append(loss)
                state.step += 1
                stepped(loss)
                if state.step % every == 0:
                    self.save()
            self.settle(train, batches[:SETTLING])
            record = {
                "epoch": state.epoch + 1,
                "train_loss": float(np.mean(state.losses)),
                **evaluate(self.network, validation, self.config.batch, self.device),
                "seconds": round(monotonic() - start, 1),
            }
            state.history.append(record)
            state.epoch, state.step, state.losses = state.epoch + 1, 0, []
            best = min(state.history, key=lambda each: each["validation_loss"])
            if best is record:
                about = {**self.about, "config": asdict(self.config), **record}
                save_weights(self.network, about, self.weights, half=True)
            self.save()
            ended(record)
        return True

    def save(self) -> None:
        """Write checkpoint and history."""
        save_checkpoint(self.folder, self._fixed(), self.network, self.optimizer, self.progress)

    def _fixed(self) -> dict[str, Any]:
        """What a training cannot change on its way: all but when it ends and how it cools."""
        config = asdict(self.config)
        config.pop("epochs")
        config.pop("cooling")
        return json.loads(
            json.dumps(
                {
                    **{f"training {k}": v for k, v in config.items()},
                    **{f"network {k}": v for k, v in asdict(self.network.config).items()},
                    **{f"examples {k}": v for k, v in self.about.items()},
                }
            )
        )

    def set_rate(self, epoch: float) -> None:
        """The learning rate after `epoch` epochs, a fraction too, of this training."""
        for group in self.optimizer.param_groups:
            group["lr"] = self.config.learning_rate * cooled(
                epoch, self.config.epochs, self.config.cooling
            )

    def settle(self, train: Examples, batches: list[NDArray[np.int64]]) -> None:
        """Batch normalisation's statistics anew: the mean of those by which these batches are
        normalised. The running ones lag behind weights that still move, and take a variance that is
        n / (n - 1) times that of the training, which for the codes of eight objects is a seventh.
        Training itself never reads them.
        """
        found: dict[torch.nn.Module, list[tuple[Tensor, Tensor]]] = {}

        def look(layer: torch.nn.Module, inputs: tuple[Tensor, ...]) -> None:
            rows = inputs[0].float()
            moments = rows.mean(dim=0), rows.var(dim=0, correction=0)
            found.setdefault(layer, []).append(moments)

        hooks = [
            layer.register_forward_pre_hook(look)
            for layer in self.network.modules()
            if isinstance(layer, torch.nn.BatchNorm1d)
        ]
        self.network.train()
        torch.manual_seed(child_seed(self.config.seed, "settle", self.progress.epoch))
        with torch.no_grad():
            for number, rows in enumerate(batches):
                clouds, queries, _ = self._draw(train, rows, "settle", number)
                self.network(clouds.to(self.device), queries.to(self.device))
        for hook in hooks:
            hook.remove()
        for layer, moments in found.items():
            assert isinstance(layer.running_mean, Tensor)
            assert isinstance(layer.running_var, Tensor)
            means, variances = zip(*moments, strict=True)
            layer.running_mean.copy_(torch.stack(means).mean(dim=0))
            layer.running_var.copy_(torch.stack(variances).mean(dim=0))

    def batches(self, count: int, epoch: int) -> list[NDArray[np.int64]]:
        """All examples once, in an order of the epoch's own, as evenly as may be: no batch is
        smaller than it should be, since batch normalisation needs two examples."""
        order = child_rng(self.config.seed, "order", epoch).permutation(count)
        return np.array_split(order, max(1, count // self.config.batch))

    def step(self, train: Examples, rows: NDArray[np.int64], step: int) -> float:
        """Step number `step` of this epoch, on these rows; gives its loss."""
        clouds, queries, labels = self._draw(train, rows, "step", step)
        torch.manual_seed(child_seed(self.config.seed, "dropout", self.progress.epoch, step))
        self.network.train()
        self.optimizer.zero_grad()
        half = self.config.precision == "bfloat16"
        with torch.autocast(torch.device(self.device).type, torch.bfloat16, enabled=half):
            logits = self.network(clouds.to(self.device), queries.to(self.device))
        loss = binary_cross_entropy_with_logits(logits.float(), labels.to(self.device))
        loss.backward()
        self.optimizer.step()
        return float(loss.detach())

    def _draw(
        self, train: Examples, rows: NDArray[np.int64], purpose: str, step: int
    ) -> tuple[Tensor, Tensor, Tensor]:
        return draw_batch(
            train,
            rows,
            self.config.queries,
            self.config.noise / self.network.config.scale,
            child_rng(self.config.seed, purpose, self.progress.epoch, step),
        )


def draw_batch(
    examples: Examples,
    rows: NDArray[np.int64],
    queries: int,
    noise: float,
    rng: np.random.Generator,
) -> tuple[Tensor, Tensor, Tensor]:
    """Noisy clouds (B, P, 3), queries (B, Q, 3) and labels (B, Q), float32.

    noise : in units of the clouds; a noisy cloud is moved so that the middle of its bounding box is
    the origin again, and its queries with it, since that is how a noisy cloud would be seen.
    """
    clouds = examples.clouds[rows].astype(np.float32)
    clouds += rng.normal(0, noise, clouds.shape).astype(np.float32)
    middle = (clouds.min(axis=1, keepdims=True) + clouds.max(axis=1, keepdims=True)) / 2
    stored = examples.queries.shape[1]
    chosen = np.stack([rng.permutation(stored)[:queries] for _ in rows])
    asked = np.take_along_axis(examples.queries[rows], chosen[..., None], axis=1)
    labels = np.take_along_axis(examples.labels[rows], chosen, axis=1)
    return (
        torch.from_numpy(clouds - middle),
        torch.from_numpy(asked.astype(np.float32) - middle),
        torch.from_numpy(labels.astype(np.float32)),
    )


@torch.no_grad()
def evaluate(network: PointSDF, examples: Examples, batch: int, device: str) -> dict[str, float]:
    """Mean loss over all queries of examples without noise, and the mean over examples of the IoU
    of their query points at `LEVEL`."""
    network.eval()
    losses, ious = [], []
    for start in range(0, len(examples), batch):
        part = slice(start, start + batch)
        clouds, queries, labels = (
            torch.from_numpy(array[part].astype(np.float32)).to(device)
            for array in (examples.clouds, examples.queries, examples.labels)
        )
        logits = network(clouds, queries)
        losses.append(
            binary_cross_entropy_with_logits(logits, labels, reduction="none").mean(dim=1)
        )
        found, true = torch.sigmoid(logits) > LEVEL, labels > 0
        both, either = (found & true).sum(dim=1), (found | true).sum(dim=1)
        ious.append(both / either.clamp(min=1))
    return {
        "validation_loss": float(torch.cat(losses).mean()),
        "validation_iou": float(torch.cat(ious).mean()),
    }


def split(names: Sequence[str], share: float, seed: int) -> tuple[list[str], list[str]]:
    """Names to train on and to validate with, each in order; at least one of either."""
    order = child_rng(seed, "validation").permutation(len(names))
    count = min(max(1, round(share * len(names))), len(names) - 1)
    held = {names[i] for i in order[:count]}
    return [n for n in names if n not in held], [n for n in names if n in held]
