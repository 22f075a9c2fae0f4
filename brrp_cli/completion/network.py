"""From per-point features to the log odds that a point is inside: a small network, fitted once.

learned.py has the larger one, which begins as this one.

`tools/fit_completion.py` fits it and says on what; brrp_cli/completion/weights.npz holds it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from io import BytesIO

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Network:
    """Layers x -> max(0, x W + b), the last without the maximum; inputs are scaled first.

    middle, spread : (F,) of the inputs; layers : (W, b) each
    """

    middle: Floats
    spread: Floats
    layers: tuple[tuple[Floats, Floats], ...]

    def logits(self, point_features: Floats) -> Floats:
        """Log odds (n,) from point_features (n, F)."""
        x = (point_features - self.middle) / self.spread
        for number, (weight, bias) in enumerate(self.layers, start=1):
            x = x @ weight + bias
            if number < len(self.layers):
                x = np.maximum(x, 0)
        return np.asarray(x[:, 0])

    def as_bytes(self) -> bytes:
        """As `from_bytes` reads it."""
        arrays = {"middle": self.middle, "spread": self.spread}
        for number, (weight, bias) in enumerate(self.layers):
            arrays |= {f"weight{number}": weight, f"bias{number}": bias}
        buffer = BytesIO()
        np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
        return buffer.getvalue()


def from_bytes(data: bytes) -> Network:
    """The network of `Network.as_bytes`."""
    with np.load(BytesIO(data), allow_pickle=False) as arrays:
        count = sum(name.startswith("weight") for name in arrays.files)
        layers = tuple((arrays[f"weight{n}"], arrays[f"bias{n}"]) for n in range(count))
        return Network(arrays["middle"], arrays["spread"], layers)


@cache
def fitted() -> Network:
    """The network that comes with the package."""
    return from_bytes((files("brrp_cli.completion") / "weights.npz").read_bytes())
