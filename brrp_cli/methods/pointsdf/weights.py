"""A trained network as one file: safetensors, with what it is and what it was trained on.

The metadata has `format` ("brrp pointsdf 1"), `network` (JSON of its NetworkConfig) and `training`
(JSON: on what, how much, how well). Tensors may be half precision; they are read as float32.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brrp_cli.dependencies import import_library
from brrp_cli.errors import WeightsError
from brrp_cli.files import atomic_path

if TYPE_CHECKING:
    from brrp_cli.methods.pointsdf.network import NetworkConfig, PointSDF

FORMAT = "brrp pointsdf 1"
# What comes with the package; docs/pointsdf.md tells what it was trained on.
OWN_WEIGHTS = Path(__file__).with_name("tabletop.safetensors")
_FIX = "pass --weights FILE with a file that tools/train_pointsdf.py wrote"


@dataclass(frozen=True)
class Weights:
    """A network, ready to answer, and what the file says of its training."""

    network: PointSDF
    training: dict[str, Any]


def save_weights(
    network: PointSDF, training: dict[str, Any], path: Path, *, half: bool = False
) -> None:
    """Write the file, whole or not at all; `half` halves its size. Errors: OutputError."""
    import torch

    safetensors = import_library("safetensors.torch")
    tensors = {
        name: tensor.detach().cpu().contiguous()
        for name, tensor in network.state_dict().items()
        # How often batch normalisation was trained is nothing that an answer needs.
        if not name.endswith("num_batches_tracked")
    }
    if half:
        tensors = {name: tensor.to(torch.float16) for name, tensor in tensors.items()}
    metadata = {
        "format": FORMAT,
        "network": json.dumps(asdict(network.config)),
        "training": json.dumps(training),
    }
    with atomic_path(path) as partial:
        partial.write_bytes(safetensors.save(tensors, metadata=metadata))


def load_weights(path: str | Path) -> Weights:
    """Read a file. Errors: WeightsError if it is missing, damaged, or of another network."""
    import torch

    from brrp_cli.methods.pointsdf.network import PointSDF

    path = Path(path)
    config, training = _describe(path)
    try:
        found = import_library("safetensors.torch").load_file(path)
        tensors = {name: tensor.to(torch.float32) for name, tensor in found.items()}
        network = PointSDF(config)
        missing = network.load_state_dict(tensors, strict=False)
    except Exception as error:  # safetensors' own exception, RuntimeError of torch, OSError
        raise _unreadable(path, error) from error
    lacking = [name for name in missing.missing_keys if not name.endswith("num_batches_tracked")]
    if lacking or missing.unexpected_keys:
        raise _unreadable(path, f"lacks {lacking[:3]}, has {missing.unexpected_keys[:3]}")
    bad = [name for name, tensor in tensors.items() if not torch.isfinite(tensor).all()]
    if bad:
        raise _unreadable(path, f"{bad[0]} is not finite")
    return Weights(network.eval().requires_grad_(False), training)


def describe_weights(path: str | Path) -> dict[str, Any]:
    """What the file says of its training, without reading the tensors. Errors: WeightsError."""
    return _describe(Path(path))[1]


def _describe(path: Path) -> tuple[NetworkConfig, dict[str, Any]]:
    from brrp_cli.methods.pointsdf.network import read_config

    if not path.is_file():
        raise WeightsError(
            "There are no weights there",
            where=path,
            found="a folder" if path.is_dir() else "nothing",
            fix=f"{_FIX}, and train with it first: its docstring has the commands",
        )
    try:
        with import_library("safetensors").safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
    except Exception as error:  # safetensors' own exception, OSError
        raise _unreadable(path, error) from error
    if metadata.get("format") != FORMAT:
        raise WeightsError(
            "The weights are not of this network",
            where=path,
            expected=FORMAT,
            found=metadata.get("format", "safetensors without a format that brrp knows"),
            fix=_FIX,
        )
    try:
        return read_config(json.loads(metadata["network"])), json.loads(metadata["training"])
    except (KeyError, TypeError, ValueError) as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, found: object) -> WeightsError:
    return WeightsError("The weights cannot be read", where=path, found=found, fix=_FIX)
