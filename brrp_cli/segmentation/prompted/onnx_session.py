"""A model of masks with the inputs and outputs that are asked of it, by name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import MaskError
from brrp_cli.learned_models import TYPES, OnnxModel

FIX = "take the files that `brrp fetch masks` brings"


class Session:
    """inputs, outputs : names that the model must have; it may have no other inputs."""

    def __init__(self, path: Path, what: str, inputs: set[str], outputs: list[str]) -> None:
        self.path, self._outputs = path, outputs
        self._model = OnnxModel(path, what, MaskError, FIX)
        has, gives = self._model.inputs, self._model.outputs
        if set(has) != inputs or not set(outputs) <= set(gives):
            raise MaskError(
                f"This is not {what}",
                where=path,
                expected=f"inputs {', '.join(sorted(inputs))}; outputs {', '.join(outputs)}",
                found=f"inputs {', '.join(sorted(has))}; outputs {', '.join(gives)}",
                fix=FIX,
            )
        self._types = {name: TYPES.get(one.type, np.float32) for name, one in has.items()}
        self.shapes = {name: list(one.shape) for name, one in has.items()}

    def __call__(self, inputs: Mapping[str, NDArray[Any]]) -> list[NDArray[Any]]:
        """The outputs, in the order in which they were asked for. Errors: MaskError."""
        fed = {name: value.astype(self._types[name]) for name, value in inputs.items()}
        return self._model.run(self._outputs, fed)
