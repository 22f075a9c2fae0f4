"""CLIP's text side before the model: prompts and tokens."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import RetrievalError
from brrp_cli.learned_models import read_tokenizer

START_TEXT, START = "<|startoftext|>", 49406
END_TEXT, END = "<|endoftext|>", 49407
CONTEXT = 77
# What stands after the end token cannot be seen by it (causal attention), so any id would do.
PADDING = 0

# What tells CLIP's own vocabulary and merges from others that have its special tokens.
GOLDEN_TEXT = "a photo of a cat"
GOLDEN = [START, 320, 1125, 539, 320, 2368, END]

_ARTICLES = ("a", "an", "the")


def prompt(description: str) -> str:
    """The paper's prompt, "a photo of a {description}", with one article, not two.

    Lower case and single spaces, as CLIP was trained.
    """
    words = description.lower().split()
    if not words or (len(words) == 1 and words[0] in _ARTICLES):
        raise RetrievalError(
            "An object of the prior has no description that CLIP could read",
            expected='a short phrase, such as "a red cracker box"',
            found=repr(description),
            fix="give it one with `brrp build-prior --descriptions FILE`",
        )
    article = [] if words[0] in _ARTICLES else ["a"]
    return " ".join(["a photo of", *article, *words])


class ClipTokenizer:
    """CLIP's lower-cased byte-level BPE, read from the hub's tokenizer.json."""

    def __init__(self, path: Path) -> None:
        # Start, end, length and padding are set here and not left to what the file says.
        self._tokenizer = read_tokenizer(path, partial(_not_clip, path))
        special = {text: self._tokenizer.token_to_id(text) for text in (START_TEXT, END_TEXT)}
        if special != {START_TEXT: START, END_TEXT: END}:
            raise _not_clip(path, found=special)
        tokens = self([GOLDEN_TEXT])[0].tolist()
        if tokens != GOLDEN:
            raise _not_clip(path, found=tokens)

    def __call__(self, texts: Sequence[str], length: int | None = None) -> NDArray[np.int64]:
        """Token ids (n, S): start, words, end, padding.

        S is `length`, or that of the longest text. A text too long for S, or for the context of
        77, loses its last words and keeps the end token, which is where CLIP reads its embedding.
        """
        limit = min(length or CONTEXT, CONTEXT)
        rows = []
        for text in texts:
            words = self._tokenizer.encode(text, add_special_tokens=False).ids
            rows.append([START, *words[: limit - 2], END])
        width = length or max(map(len, rows))
        return np.array([row + [PADDING] * (width - len(row)) for row in rows], dtype=np.int64)


def _not_clip(path: Path, found: object) -> RetrievalError:
    return RetrievalError(
        "This is not CLIP's tokenizer",
        where=path,
        expected=f"a tokenizer.json with {START_TEXT} = {START} and {END_TEXT} = {END}, by which "
        f'"{GOLDEN_TEXT}" is {GOLDEN}',
        found=found,
        fix="take tokenizer.json from the repository that the models came from",
    )
