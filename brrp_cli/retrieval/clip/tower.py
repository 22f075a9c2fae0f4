"""One tower of CLIP through onnxruntime: what the file says of itself is read, not assumed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import RetrievalError
from brrp_cli.learned_models import TYPES, OnnxModel

# The published exports' names for the embedding; a model with one output may call it anything.
_EMBEDDINGS = ("text_embeds", "image_embeds", "embedding")
_BATCH = 32


class Tower:
    """A text or vision model. `kind` is "text" (token ids, rank 2) or "vision" (pixels, rank 4).

    Input name, type and fixed sizes come from the session: int32 or int64 tokens, a batch of any
    size or one that is fixed.
    """

    def __init__(self, path: Path, kind: str) -> None:
        self.path = path
        self._model = OnnxModel(
            path, f"CLIP's {kind} model", RetrievalError, "fetch both models again: brrp fetch clip"
        )
        self._check_input(kind)
        self._output = self._choose_output()

    def _check_input(self, kind: str) -> None:
        inputs = list(self._model.inputs.values())
        rank, letters = {"text": (2, "int"), "vision": (4, "float")}[kind]
        first = inputs[0]
        known = first.type in TYPES and first.type.startswith(f"tensor({letters}")
        square = kind == "text" or all(
            not isinstance(have, int) or have == want
            for have, want in zip(first.shape[1:], (3, 224, 224), strict=False)
        )
        if len(inputs) != 1 or not known or len(first.shape) != rank or not square:
            shape = "int32 or int64 (B, S)" if kind == "text" else "float (B, 3, 224, 224)"
            raise RetrievalError(
                f"This is not CLIP ViT-B/16's {kind} model",
                where=self.path,
                expected=f"one input, {shape}",
                found=", ".join(f"{i.name} {i.type} {i.shape}" for i in inputs),
                fix="download both models from one of the two published repositories",
            )
        self._name, self._type = first.name, TYPES[first.type]
        sizes = [size if isinstance(size, int) and size > 0 else None for size in first.shape]
        self.batch, self.length = sizes[0], sizes[1]

    def _choose_output(self) -> str:
        names = self._model.outputs
        chosen = next((name for name in _EMBEDDINGS if name in names), None)
        if chosen is None and len(names) == 1:
            chosen = names[0]
        if chosen is None:
            raise RetrievalError(
                "The model has no output that is the embedding",
                where=self.path,
                expected=" or ".join(_EMBEDDINGS),
                found=", ".join(names),
                fix="use an export with projected embeddings, such as the published ones",
            )
        return str(chosen)

    def embed(self, rows: NDArray[np.generic]) -> NDArray[np.float64]:
        """Unit embeddings (n, D) of token ids (n, S) or pixels (n, 3, 224, 224), n >= 1.

        Normalised here whether the model has done so or not: doing it twice changes nothing.
        """
        size = self.batch or _BATCH
        raw = np.concatenate(
            [self._run(rows[start : start + size]) for start in range(0, len(rows), size)]
        ).astype(np.float64)
        length = np.linalg.norm(raw, axis=1, keepdims=True)
        if not np.isfinite(length).all() or not (length > 0).all():
            raise RetrievalError(
                "The model's output is not an embedding",
                where=self.path,
                expected="finite numbers that are not all zero",
                found="NaN or infinity" if not np.isfinite(raw).all() else "zeros",
                fix="download the file again and compare its sha256 with the hub's",
            )
        return np.asarray(raw / length, dtype=np.float64)

    def _run(self, rows: NDArray[np.generic]) -> NDArray[np.floating]:
        short = (self.batch or len(rows)) - len(rows)
        full = np.concatenate([rows, np.repeat(rows[-1:], short, axis=0)]) if short else rows
        (out,) = self._model.run([self._output], {self._name: full.astype(self._type)})
        if out.ndim != 2 or len(out) != len(full):
            raise RetrievalError(
                "The model's output is not one embedding for each input",
                where=self.path,
                expected=(len(full), "D"),
                found=out.shape,
                fix="use an export with projected embeddings, such as the published ones",
            )
        return out[: len(rows)]
