"""Networks that come with the package, each as one file: safetensors, in half precision.

The metadata has `format`, `network` (JSON of its config, a dataclass) and `training`
(JSON: on what, how much, how well).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from brrp_cli.dependencies import import_library
from brrp_cli.errors import WeightsError
from brrp_cli.files import write_bytes

if TYPE_CHECKING:
    from torch import Tensor, nn

    N = TypeVar("N", bound=nn.Module)


def save_network(
    network: nn.Module, config: Any, kind: str, training: dict[str, Any], path: Path
) -> None:
    """Write the file, whole or not at all. config : a dataclass; kind : the file's `format`.
    Errors: OutputError."""
    import torch

    tensors = {
        name: tensor.detach().to(torch.float16).contiguous()
        for name, tensor in network.state_dict().items()
    }
    metadata = {
        "format": kind,
        "network": json.dumps(asdict(config)),
        "training": json.dumps(training),
    }
    write_bytes(path, import_library("safetensors.torch").save(tensors, metadata=metadata))


def load_network(path: Path, kind: str, what: str, build: Callable[[dict[str, Any]], N]) -> N:
    """The network of a file, to be asked. build : makes it from its config; what : its name in
    messages. Errors: WeightsError if the file is missing, damaged or of another kind."""
    import torch

    with _told(path, kind, what):
        metadata, tensors = _read(path, kind)
        # Without numbers of its own: none are drawn from torch's random state.
        with torch.device("meta"):
            network = build(json.loads(metadata["network"]))
        network.load_state_dict(tensors, assign=True)
    return network.eval().requires_grad_(False)


def _read(path: Path, kind: str) -> tuple[dict[str, str], dict[str, Tensor]]:
    """Metadata and weights."""
    import torch

    with import_library("safetensors").safe_open(path, framework="pt") as file:
        metadata = file.metadata() or {}
        tensors = {name: file.get_tensor(name).to(torch.float32) for name in file.keys()}  # noqa: SIM118
    if metadata.get("format") != kind:
        raise ValueError(f"its format is {metadata.get('format')}")
    return metadata, tensors


@contextmanager
def _told(path: Path, kind: str, what: str) -> Iterator[None]:
    """What goes wrong in reading becomes a WeightsError."""
    try:
        yield
    except Exception as error:  # safetensors' own exception, RuntimeError of torch, OSError
        raise WeightsError(
            f"The weights of {what} cannot be read",
            where=path,
            expected=kind,
            found=error,
            fix="install brrp-cli again",
        ) from error
