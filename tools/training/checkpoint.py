"""How far a training is, kept in its folder, so that what was interrupted goes on."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import torch

from brrp_cli.errors import BrrpError
from brrp_cli.files import atomic_path, write_bytes

CHECKPOINT, HISTORY = "checkpoint.pt", "history.json"


@dataclass
class Progress:
    """Where a training is: `step` steps of `epoch` are done, with `losses` so far.

    history : a record for each epoch that is over
    """

    epoch: int = 0
    step: int = 0
    losses: list[float] = field(default_factory=list)
    history: list[dict[str, float]] = field(default_factory=list)


def save_checkpoint(
    folder: Path,
    fixed: dict[str, Any],
    network: torch.nn.Module,
    optimizer: torch.optim.Optimizer,
    progress: Progress,
) -> None:
    """Write checkpoint and history. fixed : what a training cannot change on its way"""
    with atomic_path(folder / CHECKPOINT) as partial:
        torch.save(
            {
                "fixed": fixed,
                "network": network.state_dict(),
                "optimizer": optimizer.state_dict(),
                "progress": asdict(progress),
            },
            partial,
        )
    lines = json.dumps(progress.history, indent=1) + "\n"
    write_bytes(folder / HISTORY, lines.encode())


def restore_checkpoint(
    folder: Path,
    fixed: dict[str, Any],
    network: torch.nn.Module,
    optimizer: torch.optim.Optimizer,
    device: torch.device | str = "cpu",
) -> Progress:
    """Bring network and optimizer to where the checkpoint is. Errors: BrrpError if it is damaged or
    that of a training with something else `fixed`."""
    path = folder / CHECKPOINT
    try:
        found = torch.load(path, map_location=device, weights_only=True)
        kept = found["fixed"]
        if kept == fixed:
            network.load_state_dict(found["network"])
            optimizer.load_state_dict(found["optimizer"])
            return Progress(**found["progress"])
    except Exception as error:  # torch and pickle raise whatever they like
        raise BrrpError(
            "The checkpoint cannot be read", where=path, found=error, fix="delete it"
        ) from error
    names = [name for name in fixed if kept.get(name) != fixed[name]]
    raise BrrpError(
        "The folder holds another training",
        where=path,
        expected=", ".join(f"{name} = {fixed[name]}" for name in names),
        found=", ".join(f"{name} = {kept.get(name)}" for name in names),
        fix="choose another folder with -o, or the options that it was begun with",
    )


def cooled(epoch: float, epochs: int, cooling: int) -> float:
    """The share of the learning rate after `epoch` epochs: 1, then half a cosine down to 0 over the
    last `cooling` of `epochs`."""
    past = epoch - (epochs - cooling)
    return 1.0 if past <= 0 else (1 + math.cos(math.pi * past / cooling)) / 2
