"""A training in epochs that may be stopped at any step, and goes on as if it had not been.

All that is random in a step comes from the seed, the epoch and the step's number alone. A
checkpoint holds everything else that a step depends on (on the CPU to the last bit; CUDA adds in no
fixed order).
"""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from time import monotonic
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray

from brrp_cli.seeds import child_rng, child_seed
from training.checkpoint import (
    CHECKPOINT,
    Progress,
    cooled,
    restore_checkpoint,
    save_checkpoint,
)


@dataclass(frozen=True)
class EpochsConfig:
    """What every training has.

    batch : objects in a step; rate : the learning rate
    cooling : epochs at the end over which the learning rate falls to nothing, by half a cosine;
        warming : steps at the start over which it rises
    """

    epochs: int
    cooling: int
    batch: int
    rate: float
    warming: int = 0
    seed: int = 0


class _Examples(Protocol):
    def __len__(self) -> int: ...


E = TypeVar("E", bound=_Examples)
# What a step learns from.
B = TypeVar("B")


class EpochTraining(ABC, Generic[E, B]):
    """A training in a folder: checkpoint.pt, history.json, and what `keep` writes of the epoch
    whose record has the least `CRITERION`.

    Errors: BrrpError if the folder holds a training with something else `fixed`, or a damaged one.
    """

    CRITERION: str

    def __init__(
        self,
        config: EpochsConfig,
        network: torch.nn.Module,
        optimizer: torch.optim.Optimizer,
        folder: Path,
        fixed: dict[str, Any],
        device: str = "cpu",
    ) -> None:
        self.config, self.folder, self.device = config, folder, device
        self.network, self.optimizer = network, optimizer
        # What a training cannot change on its way: all but when it ends and how it cools.
        own = {k: v for k, v in asdict(config).items() if k not in ("epochs", "cooling")}
        own = {f"training {name}": value for name, value in own.items()}
        self.fixed = dict(json.loads(json.dumps({**own, **fixed})))
        self.progress = Progress()
        if (folder / CHECKPOINT).exists():
            self.progress = restore_checkpoint(folder, self.fixed, network, optimizer, device)

    def run(
        self,
        train: E,
        held: E,
        *,
        every: int = 100,
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
            for step, batch in self._all_drawn(train, batches):
                if not go_on():
                    self.save()
                    return False
                self.set_rate(step, len(batches))
                state.losses.append(self.step(batch, step))
                state.step += 1
                stepped(state.losses[-1])
                if state.step % every == 0:
                    self.save()
            self.settle(train, batches)
            record = {
                "epoch": state.epoch + 1,
                "train_loss": float(np.mean(state.losses)),
                **self.scores(held),
                "seconds": round(monotonic() - start, 1),
            }
            state.history.append(record)
            state.epoch, state.step, state.losses = state.epoch + 1, 0, []
            if min(state.history, key=lambda each: each[self.CRITERION]) is record:
                self.keep(record)
            self.save()
            ended(record)
        return True

    def step(self, batch: B, number: int) -> float:
        """Step `number` of this epoch, on what was drawn for it; gives its loss."""
        torch.manual_seed(child_seed(self.config.seed, "dropout", self.progress.epoch, number))
        return self.learn(batch)

    def drawn(self, train: E, rows: NDArray[np.int64], number: int) -> B:
        """What step `number` of this epoch learns from, of these rows."""
        return self.draw(train, rows, self.rng("step", number))

    def _all_drawn(self, train: E, batches: list[NDArray[np.int64]]) -> Iterator[tuple[int, B]]:
        """The steps that are left of this epoch, and what each learns from, which is drawn while
        the one before learns."""

        def draw(step: int) -> B:
            return self.drawn(train, batches[step], step)

        steps = range(self.progress.step, len(batches))
        with ThreadPoolExecutor(1) as pool:
            drawn = [pool.submit(draw, step) for step in steps[:1]]
            for step in steps:
                batch = drawn.pop().result()
                drawn += [pool.submit(draw, step + 1)] if step + 1 in steps else []
                yield step, batch

    @abstractmethod
    def draw(self, train: E, rows: NDArray[np.int64], rng: np.random.Generator) -> B:
        """What a step learns from, of these rows. Another thread may be learning meanwhile."""

    @abstractmethod
    def learn(self, batch: B) -> float:
        """Learn from what was drawn, and give the loss on it."""

    @abstractmethod
    def scores(self, held: E) -> dict[str, float]:
        """How well the network does on examples that it does not learn from."""

    @abstractmethod
    def keep(self, record: dict[str, float]) -> None:
        """Write the network, whose epoch was the best so far."""

    def settle(self, train: E, batches: list[NDArray[np.int64]]) -> None:
        """What has to be done at the end of an epoch, before the network is scored: nothing."""

    def rng(self, purpose: str, step: int) -> np.random.Generator:
        """Random numbers of step `step` of this epoch."""
        return child_rng(self.config.seed, purpose, self.progress.epoch, step)

    def batches(self, count: int, epoch: int) -> list[NDArray[np.int64]]:
        """All examples once, in an order of the epoch's own, as evenly as may be: no batch is
        smaller than it should be, since batch normalisation needs two examples."""
        order = child_rng(self.config.seed, "order", epoch).permutation(count)
        return np.array_split(order, max(1, count // self.config.batch))

    def set_rate(self, step: int, steps: int) -> None:
        """The learning rate of step `step` of the `steps` of this epoch."""
        own = self.config
        done = self.progress.epoch * steps + step
        warm = min(1.0, (done + 1) / max(1, own.warming))
        for group in self.optimizer.param_groups:
            group["lr"] = own.rate * warm * cooled(done / steps, own.epochs, own.cooling)

    def save(self) -> None:
        """Write checkpoint and history."""
        save_checkpoint(self.folder, self.fixed, self.network, self.optimizer, self.progress)
