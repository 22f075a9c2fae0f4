"""Files of learned models: ONNX sessions and tokenizers that say in our words what is wrong."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library
from brrp_cli.errors import BrrpError

# What an input of a model may be.
TYPES: dict[str, type[np.generic]] = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(int64)": np.int64,
    "tensor(int32)": np.int32,
    "tensor(bool)": np.bool_,
}


class OnnxModel:
    """A model on the CPU. what : its name in messages; kind : class of the errors; fix : what to do
    about a file that cannot be read, or fails when it is run; threads : of one run, None: all"""

    def __init__(
        self,
        path: Path,
        what: str,
        kind: type[BrrpError],
        fix: str,
        threads: int | None = None,
    ) -> None:
        self.path, self.what, self._kind, self._fix = path, what, kind, fix
        self._session = self._open(threads)
        self.inputs = {one.name: one for one in self._session.get_inputs()}
        self.outputs: list[str] = [one.name for one in self._session.get_outputs()]

    @property
    def metadata(self) -> dict[str, str]:
        """What the file says of itself."""
        return dict(self._session.get_modelmeta().custom_metadata_map)

    def _open(self, threads: int | None) -> Any:
        runtime = import_library("onnxruntime")
        options = runtime.SessionOptions()
        options.log_severity_level = 4  # its chatter on stderr is not for users; errors are raised
        options.intra_op_num_threads = threads or 0
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
        raise self.error("cannot be read", last, expected="an ONNX model") from last

    def run(self, outputs: Sequence[str], inputs: Mapping[str, NDArray[Any]]) -> list[NDArray[Any]]:
        """The outputs, in the order in which they were asked for."""
        options = import_library("onnxruntime").RunOptions()
        # What a run of the network that parts objects needs, 130 MB, is given back after it.
        options.add_run_config_entry("memory.enable_memory_arena_shrinkage", "cpu:0")
        try:
            found = self._session.run(list(outputs), dict(inputs), options)
            return [np.asarray(out) for out in found]
        except Exception as error:
            raise self.error("fails when it is run", error) from error

    def error(self, trouble: str, found: object, expected: str | None = None) -> BrrpError:
        """What is wrong with the file. trouble : as in "cannot be read"."""
        return self._kind(
            f"{self.what[0].upper()}{self.what[1:]} {trouble}",
            where=self.path,
            expected=expected,
            found=str(found).splitlines()[0],
            fix=self._fix,
        )


def read_tokenizer(path: Path, wrong: Callable[[object], BrrpError]) -> Any:
    """The hub's tokenizer.json; what it says of length and padding is left out.

    wrong : makes the error from what was found.
    """
    try:
        tokenizer = import_library("tokenizers").Tokenizer.from_file(str(path))
    except Exception as error:  # the library raises a bare Exception for what it cannot read
        raise wrong(str(error)) from error
    tokenizer.no_truncation()
    tokenizer.no_padding()
    return tokenizer
