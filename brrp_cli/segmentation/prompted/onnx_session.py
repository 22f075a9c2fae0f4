"""An ONNX model that tells in our words what is wrong with it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library
from brrp_cli.errors import MaskError

_TYPES = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(int64)": np.int64,
    "tensor(int32)": np.int32,
    "tensor(bool)": np.bool_,
}


class Session:
    """A model with the inputs and outputs that are asked of it, by name.

    inputs, outputs : names that it must have; it may have no other inputs
    """

    def __init__(self, path: Path, what: str, inputs: set[str], outputs: list[str]) -> None:
        self.path, self.what, self._outputs = path, what, outputs
        self._session = self._open()
        has = {one.name: one for one in self._session.get_inputs()}
        gives = [one.name for one in self._session.get_outputs()]
        if set(has) != inputs or not set(outputs) <= set(gives):
            raise MaskError(
                f"This is not {what}",
                where=path,
                expected=f"inputs {', '.join(sorted(inputs))}; outputs {', '.join(outputs)}",
                found=f"inputs {', '.join(sorted(has))}; outputs {', '.join(gives)}",
                fix="take the files that `brrp fetch masks` brings",
            )
        self._types = {name: _TYPES.get(one.type, np.float32) for name, one in has.items()}
        self.shapes = {name: list(one.shape) for name, one in has.items()}

    def _open(self) -> Any:
        runtime = import_library("onnxruntime")
        options = runtime.SessionOptions()
        options.log_severity_level = 4  # its chatter on stderr is not for users; errors are raised
        levels = runtime.GraphOptimizationLevel
        # Optimising trips over the casts of the 4-bit detector; unoptimised it is right, and slow.
        for level in (levels.ORT_ENABLE_ALL, levels.ORT_DISABLE_ALL):
            options.graph_optimization_level = level
            try:
                return runtime.InferenceSession(
                    str(self.path), options, providers=["CPUExecutionProvider"]
                )
            except Exception as error:  # its errors have no common base but Exception
                last = error
        raise MaskError(
            f"{self.what[0].upper()}{self.what[1:]} cannot be read",
            where=self.path,
            expected="an ONNX model",
            found=str(last).splitlines()[0],
            fix="fetch it again: brrp fetch masks",
        ) from last

    def __call__(self, inputs: Mapping[str, NDArray[Any]]) -> list[NDArray[Any]]:
        """The outputs, in the order in which they were asked for. Errors: MaskError."""
        fed: dict[str, NDArray[Any]] = {
            name: value.astype(self._types[name]) for name, value in inputs.items()
        }
        try:
            return [np.asarray(out) for out in self._session.run(self._outputs, fed)]
        except Exception as error:
            raise MaskError(
                f"{self.what[0].upper()}{self.what[1:]} fails when it is run",
                where=self.path,
                found=str(error).splitlines()[0],
                fix="take the files that `brrp fetch masks` brings",
            ) from error
