"""A training that somebody watches: a bar of its steps, a line for each epoch, and an end when time
is over or on Ctrl-C."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import TYPE_CHECKING, Any

import click
from tqdm import tqdm

from training.interrupted import signalled

if TYPE_CHECKING:
    from training.epochs import EpochTraining


def told(record: dict[str, float]) -> str:
    """All numbers of an epoch's record, in a line."""
    return ", ".join(f"{name} {value:.4g}" for name, value in record.items())


def run_watched(
    training: EpochTraining[Any, Any],
    train: Any,
    held: Any,
    late: Callable[[], bool],
    *,
    every: int = 100,
    line: Callable[[dict[str, float]], str] = told,
) -> bool:
    """Train to the last epoch; False, which is told, if it is `late` or was interrupted before.

    every : steps between checkpoints; line : what is told of an epoch's record
    """
    done, steps = training.progress, len(training.batches(len(train), 0))
    if done.epoch or done.step:
        click.echo(f"Going on after epoch {done.epoch}, step {done.step}", err=True)
    total, before = training.config.epochs * steps, done.epoch * steps + done.step
    with tqdm(total=total, initial=before, desc="steps") as bar, signalled() as stop:

        def stepped(loss: float) -> None:
            bar.set_postfix(loss=f"{loss:.4f}", refresh=False)
            bar.update()

        finished = training.run(
            train,
            held,
            every=every,
            go_on=lambda: not (late() or stop.is_set()),
            stepped=stepped,
            ended=lambda record: bar.write(line(record)),
        )
    if not finished:
        click.echo(f"Stopped in epoch {done.epoch + 1}; the same command goes on")
    return finished


def late_after(minutes: float | None) -> Callable[[], bool]:
    """Whether so many minutes have passed since now; None = never."""
    began = monotonic()
    return lambda: minutes is not None and monotonic() - began >= 60 * minutes
