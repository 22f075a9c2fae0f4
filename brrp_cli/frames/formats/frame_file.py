"""Frame files of ours, with contact_graspnet's keys: .npz."""

from __future__ import annotations

from pathlib import Path

from brrp_cli.errors import FrameError
from brrp_cli.frames.format import Format, FrameRequest
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.npz import load_frame

_UNPICKLE = (
    "python -c \"import numpy as np; d = np.load('IN.npy', allow_pickle=True).item(); "
    "np.savez('OUT.npz', **d)\", if you trust the file"
)


def read(path: Path, request: FrameRequest) -> Frame:
    """See `load_frame`; masks may be missing. Errors: FrameError, also for contact_graspnet's .npy
    files, which are pickles and could run any code when they are loaded."""
    request.refuse(path, "one frame, with its K", index="--index", intrinsics="--intrinsics")
    if path.suffix == ".npy":
        raise FrameError(
            "An .npy file is no frame",
            where=path,
            expected="an .npz with depth and K, or xyz",
            found="one array, or a pickled dictionary (contact_graspnet's), which is never loaded",
            fix=_UNPICKLE,
        )
    return load_frame(path, depth_scale=request.depth_scale, masks=False)


FORMAT = Format(
    title="a frame file, or contact_graspnet's",
    layout=".npz with depth and K, or xyz",
    matches=lambda path: path.is_file() and path.suffix in (".npz", ".npy"),
    read=read,
)
