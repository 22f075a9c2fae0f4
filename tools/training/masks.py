"""Training of the network that parts objects (affinity_network.py)."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits as cross_entropy

from brrp_cli.files import atomic_path
from brrp_cli.seeds import child_seed
from brrp_cli.segmentation.pixel_pairs import OFFSETS, windows
from training.affinity_file import load_weights
from training.affinity_network import AffinityNetwork, AffinityNetworkConfig
from training.epochs import EpochsConfig, EpochTraining
from training.mask_batches import Batch, draw_batch
from training.mask_examples import Examples

BEST = "best.pt"
# Of a pair of two objects, beside one of an object and the table or itself: they are few, and
# what masks are judged by.
APART = 4.0
# Of the loss of what is an object at all.
OBJECT = 0.5


@dataclass(frozen=True)
class TrainingConfig(EpochsConfig):
    """How to train (AdamW, binary cross-entropy).

    size : rows and columns of the windows
    precision : "float32" or "bfloat16", of the products; weights are float32 either way
    """

    epochs: int = 10
    cooling: int = 9
    batch: int = 8
    rate: float = 3e-3
    warming: int = 100
    size: tuple[int, int] = (288, 384)
    decay: float = 0.02
    precision: str = "float32"


def started(config: AffinityNetworkConfig, seed: int) -> AffinityNetwork:
    """A network that knows nothing."""
    torch.manual_seed(child_seed(seed, "network"))
    return AffinityNetwork(config)


def resumed(path: Path, seed: int) -> AffinityNetwork:
    """A network to train on: what it has in common with that of a file that `tools/train_masks.py`
    wrote, also one of other layers, is as it is there. Errors: WeightsError."""
    network = started(AffinityNetworkConfig(), seed)
    own = network.state_dict()
    same = {n: t for n, t in load_weights(path).items() if n in own and own[n].shape == t.shape}
    network.load_state_dict(same, strict=False)
    return network


def pairs(labels: Tensor, offset: tuple[int, int]) -> tuple[Tensor, Tensor, tuple[slice, slice]]:
    """Labels (B, h', w') of pixels and of their partners, where both are in the image (B, h, w),
    and the window of the former."""
    window, partner = windows(offset, tuple(labels.shape[1:]))
    return labels[:, *window], labels[:, *partner], window


def loss_of(logits: Tensor, labels: Tensor) -> Tensor:
    """The loss of logits (B, len(OFFSETS) + 1, h, w) for labels (B, h, w): pairs of the table are
    not asked for."""
    # Unbound: the gradient of a slice would be as large as all of them.
    *same_logits, object_logits = logits.unbind(1)
    total = OBJECT * cross_entropy(object_logits, (labels > 0).float())
    for said, offset in zip(same_logits, OFFSETS, strict=True):
        first, second, window = pairs(labels, offset)
        both = (first > 0) & (second > 0)
        same = first == second
        weight = torch.where(both & ~same, APART, 1.0) * ((first > 0) | (second > 0))
        each = cross_entropy(said[:, *window], same.float(), weight, reduction="sum")
        total = total + each / weight.sum().clamp_min(1) / len(OFFSETS)
    return total


class Training(EpochTraining[Examples, Batch]):
    """A training whose best epoch, that with the least loss on held scenes, is in best.pt."""

    CRITERION = "held_loss"
    config: TrainingConfig
    network: AffinityNetwork

    def __init__(
        self, begun: AffinityNetwork, config: TrainingConfig, folder: Path, views: int
    ) -> None:
        optimizer = torch.optim.AdamW(begun.parameters(), config.rate, weight_decay=config.decay)
        super().__init__(config, begun, optimizer, folder, {**asdict(begun.config), "views": views})

    def draw(self, train: Examples, rows: NDArray[np.int64], rng: np.random.Generator) -> Batch:
        """Channels and labels of windows of these views."""
        return draw_batch(train, rows, self.config.size, rng)

    def learn(self, batch: Batch) -> float:
        """Learn from what was drawn, and give the loss on it."""
        channels, labels = batch
        self.network.train()
        self.optimizer.zero_grad()
        with torch.autocast("cpu", torch.bfloat16, enabled=self.config.precision == "bfloat16"):
            logits = self.network(channels)
        loss = loss_of(logits.float(), labels)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self.optimizer.step()
        return float(loss.detach())

    def scores(self, held: Examples) -> dict[str, float]:
        """Loss on whole images, and shares of pairs of one and of two objects that are told to be
        such."""
        self.network.eval()
        losses, right = [], np.zeros((2, 2))
        with torch.no_grad():
            for channels, labels in zip(held.channels, held.labels, strict=True):
                logits = self.network(torch.from_numpy(channels)[None].float() / 63)
                asked = torch.from_numpy(labels.astype(np.int64))[None]
                losses.append(float(loss_of(logits, asked)))
                for index, offset in enumerate(OFFSETS):
                    first, second, window = pairs(asked, offset)
                    both, same = (first > 0) & (second > 0), first == second
                    said = logits[:, index][:, *window] > 0
                    for row, among in enumerate((both & same, both & ~same)):
                        right[row] += [
                            float((said == bool(1 - row))[among].sum()),
                            float(among.sum()),
                        ]
        one, two = right[:, 0] / np.maximum(right[:, 1], 1)
        return {
            "held_loss": float(np.mean(losses)),
            "one_object": float(one),
            "two_objects": float(two),
        }

    def keep(self, record: dict[str, float]) -> None:
        """Write best.pt."""
        with atomic_path(self.folder / BEST) as partial:
            torch.save(self.network.state_dict(), partial)

    def best(self) -> AffinityNetwork:
        """The network of the best epoch."""
        found = AffinityNetwork(self.network.config)
        found.load_state_dict(torch.load(self.folder / BEST, weights_only=True))
        return found.eval()
