"""Training of PointSDF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from brrp_cli.methods.pointsdf.network import NetworkConfig, PointSDF
from brrp_cli.methods.pointsdf.weights import save_weights
from brrp_cli.seeds import child_rng, child_seed
from training.epochs import EpochsConfig, EpochTraining
from training.examples import Examples

# Clouds, queries and labels.
Batch = tuple[Tensor, Tensor, Tensor]

LEVEL = 0.3
SETTLING = 32  # batches


@dataclass(frozen=True)
class TrainingConfig(EpochsConfig):
    """How to train (Adam, binary cross-entropy).

    queries : of each object, drawn anew for each step
    noise : metres, standard deviation of each coordinate of a cloud's points
    precision : "float32" or "bfloat16", of the products; weights are float32 either way
    """

    epochs: int = 50
    cooling: int = 0
    batch: int = 16
    rate: float = 1e-3
    queries: int = 512
    noise: float = 0.002
    precision: str = "float32"


def narrowed(config: NetworkConfig, width: float) -> NetworkConfig:
    """`config` with `width` times as many features in every layer but the two codes."""

    def fewer(count: int) -> int:
        return max(8, round(count * width))

    features = tuple(tuple(fewer(n) for n in layer) for layer in config.features)
    return replace(config, features=features, hidden=fewer(config.hidden))


class Training(EpochTraining[Examples, Batch]):
    """A training that writes its best epoch to the file `weights`.

    about : what the weights' file is to say of the examples, plain JSON; device : torch's name
    """

    CRITERION = "validation_loss"
    config: TrainingConfig
    network: PointSDF

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
        self.weights, self.about = weights, about
        begun = PointSDF(network).to(device)
        fixed = {
            **{f"network {k}": v for k, v in asdict(network).items()},
            **{f"examples {k}": v for k, v in about.items()},
        }
        optimizer = torch.optim.Adam(begun.parameters(), config.rate)
        super().__init__(config, begun, optimizer, folder, fixed, device)

    def keep(self, record: dict[str, float]) -> None:
        """Write the weights."""
        about = {**self.about, "config": asdict(self.config), **record}
        save_weights(self.network, about, self.weights, half=True)

    def scores(self, held: Examples) -> dict[str, float]:
        """As `evaluate`, of the network as it is."""
        return evaluate(self.network, held, self.config.batch, self.device)

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
            for number, rows in enumerate(batches[:SETTLING]):
                clouds, queries, _ = self.draw(train, rows, self.rng("settle", number))
                self.network(clouds.to(self.device), queries.to(self.device))
        for hook in hooks:
            hook.remove()
        for layer, moments in found.items():
            assert isinstance(layer.running_mean, Tensor)
            assert isinstance(layer.running_var, Tensor)
            means, variances = zip(*moments, strict=True)
            layer.running_mean.copy_(torch.stack(means).mean(dim=0))
            layer.running_var.copy_(torch.stack(variances).mean(dim=0))

    def draw(self, train: Examples, rows: NDArray[np.int64], rng: np.random.Generator) -> Batch:
        """Clouds, queries and labels of these rows."""
        noise = self.config.noise / self.network.config.scale
        return draw_batch(train, rows, self.config.queries, noise, rng)

    def learn(self, batch: Batch) -> float:
        """Learn from what was drawn, and give the loss on it."""
        clouds, queries, labels = batch
        self.network.train()
        self.optimizer.zero_grad()
        half = self.config.precision == "bfloat16"
        with torch.autocast(torch.device(self.device).type, torch.bfloat16, enabled=half):
            logits = self.network(clouds.to(self.device), queries.to(self.device))
        loss = binary_cross_entropy_with_logits(logits.float(), labels.to(self.device))
        loss.backward()
        self.optimizer.step()
        return float(loss.detach())


def draw_batch(
    examples: Examples,
    rows: NDArray[np.int64],
    queries: int,
    noise: float,
    rng: np.random.Generator,
) -> Batch:
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
