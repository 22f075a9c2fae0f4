"""Where the readers find files, for as long as the process lives."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from pathlib import Path

WORK = Path(tempfile.mkdtemp(prefix="brrp_fuzz_"))
atexit.register(shutil.rmtree, WORK, ignore_errors=True)

# A small prior, whose manifest lies beside whatever index is tried.
PRIOR = WORK / "prior"

# Folders of frames: what is read, and the files that inputs stand in for, one at a time.
FOLDERS = {
    "bop": ("scene_camera.json", "scene_gt.json"),
    "freiburg1": ("rgb.txt", "depth.txt", "groundtruth.txt"),
    "view/0000": ("../objects.json", "depth.npy", "camera.npz", "seg_mask.npy"),
    "real": ("xyz.npy", "segmentation.npy"),
    "recording": ("camera_intrinsic.json", "depth/000000.png"),
}
REPLACED = [(folder, name) for folder, names in FOLDERS.items() for name in names]


def written(data: bytes, name: str) -> Path:
    """A file with these bytes."""
    path = WORK / name
    path.write_bytes(data)
    return path
