"""Heavy libraries, imported where they are used, with a message that says how to mend a failure."""

from __future__ import annotations

import importlib
from types import ModuleType
from typing import Any

from brrp_cli.errors import DependencyError

_FIXES = {
    "libusb": "sudo apt-get install libusb-1.0-0, or pip install 'open3d<0.20', which needs none",
    "libGL": "sudo apt-get install libgl1",
    "libgomp": "sudo apt-get install libgomp1",
    "libX11": "sudo apt-get install libx11-6",
}


def import_library(name: str) -> ModuleType:
    """Import `name`; a missing package or system library becomes a DependencyError."""
    try:
        return importlib.import_module(name)
    except (ImportError, OSError) as error:
        found = str(error)
        fix = next(
            (text for library, text in _FIXES.items() if library in found),
            f"pip install {name.split('.')[0]}, in the environment that runs brrp",
        )
        raise DependencyError(f"{name} does not load", found=found, fix=fix) from error


def import_open3d() -> Any:
    """Open3D, with its own chatter turned down to errors."""
    o3d = import_library("open3d")
    o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
    return o3d
