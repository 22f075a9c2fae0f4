"""Training of the completion that has learned shapes (brrp_cli/completion/shape_network.py)."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from fit_completion import JITTER, JITTER_WHOLE
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits as cross_entropy

from brrp_cli.completion.learned import load_shapes
from brrp_cli.completion.network import Network
from brrp_cli.completion.point_features import WHOLE
from brrp_cli.completion.shape_network import ShapeNetwork, ShapeNetworkConfig
from brrp_cli.files import atomic_path
from brrp_cli.seeds import child_seed
from training.completion_examples import Examples
from training.epochs import EpochsConfig, EpochTraining

# Volumes, lengths, places, and what lies inside.
Batch = tuple[Tensor, Tensor, Tensor, Tensor]

BEST = "best.pt"
# Of the loss of the volume's features alone: the U-Net learns shapes sooner.
ALONE = 0.3
# Between which temperatures the least loss is looked for.
TEMPERATURES = np.geomspace(0.5, 2.0, 57)


@dataclass(frozen=True)
class TrainingConfig(EpochsConfig):
    """How to train (AdamW, binary cross-entropy).

    points : of each object, drawn anew for each step
    """

    epochs: int = 6
    cooling: int = 5
    batch: int = 8
    rate: float = 2e-3
    warming: int = 100
    points: int = 512
    decay: float = 0.02


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


def resumed(path: Path) -> ShapeNetwork:
    """A network to train on, from a file that `tools/train_completion.py` wrote. Errors:
    WeightsError."""
    found = load_shapes(path).requires_grad_(True)
    found.temperature.fill_(1.0)
    return found


class Training(EpochTraining[Examples, Batch]):
    """A training whose best epoch, that with the least loss on held-out shapes, is in best.pt.

    begun : what it begins as
    """

    CRITERION = "nll"
    config: TrainingConfig
    network: ShapeNetwork

    def __init__(
        self, begun: ShapeNetwork, config: TrainingConfig, folder: Path, objects: int
    ) -> None:
        # Channels last: a third faster for several objects at once.
        network = begun.to(memory_format=torch.channels_last_3d)
        optimizer = torch.optim.AdamW(network.parameters(), config.rate, weight_decay=config.decay)
        fixed = {**asdict(begun.config), "objects": objects}
        super().__init__(config, network, optimizer, folder, fixed)
        self.jitter = torch.full((begun.config.lengths,), JITTER)
        self.jitter[-WHOLE:] = JITTER_WHOLE

    def draw(self, train: Examples, rows: NDArray[np.int64], rng: np.random.Generator) -> Batch:
        """Of these objects, as `draw_batch` gives it."""
        return draw_batch(train, rows, self.config.points, rng)

    def learn(self, batch: Batch) -> float:
        """Learn from what was drawn, and give the loss on it."""
        volumes, lengths, places, inside = batch
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

    def scores(self, held: Examples) -> dict[str, float]:
        """As `scores`, of the network as it is."""
        return scores(logits_of(self.network, held, self.config.batch), held)

    def keep(self, record: dict[str, float]) -> None:
        """Write best.pt."""
        with atomic_path(self.folder / BEST) as partial:
            torch.save(self.network.state_dict(), partial)

    def best(self, held: Examples) -> ShapeNetwork:
        """The network of the best epoch, its temperature fitted to held-out shapes."""
        found = ShapeNetwork(self.network.config)
        found.load_state_dict(torch.load(self.folder / BEST, weights_only=True))
        found.temperature.fill_(1.0)
        logits = logits_of(found, held, self.config.batch)
        losses = [scores(logits / t, held)["nll"] for t in TEMPERATURES]
        found.temperature.fill_(float(TEMPERATURES[int(np.argmin(losses))]))
        return found.eval().requires_grad_(False)


def draw_batch(
    examples: Examples, rows: NDArray[np.int64], points: int, rng: np.random.Generator
) -> Batch:
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
