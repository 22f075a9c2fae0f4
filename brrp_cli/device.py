"""Where tensors are computed."""

from __future__ import annotations

from brrp_cli.errors import BrrpError


def pick_device(device: str) -> str:
    """`auto` is CUDA where there is one. Errors: BrrpError when CUDA is asked for in vain."""
    import torch

    if device == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    if device == "cuda" and not torch.cuda.is_available():
        raise BrrpError(
            "No CUDA device can be used",
            expected="a GPU and a CUDA build of torch",
            found=f"torch {torch.__version__}",
            fix="pass --device cpu, or install a CUDA build of torch",
        )
    return device
