"""Heavy libraries, imported where they are used, with a message that says how to mend a failure."""

from __future__ import annotations

import ctypes
import importlib
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import cache
from threading import Lock
from types import ModuleType
from typing import Any

from brrp_cli.errors import DependencyError

# Open3D and pymeshlab link to these also where nothing is ever shown on a screen. All at once:
# who lacks one lacks the others.
_SYSTEM_PACKAGES = (
    "sudo apt-get install --no-install-recommends libx11-6 libgl1 libopengl0 libgomp1 "
    "(Debian, Ubuntu)"
)
_FIXES = {
    "libusb": "pip install 'open3d<0.20', which needs none, or sudo apt-get install libusb-1.0-0",
    "libX11": _SYSTEM_PACKAGES,
    "libGL": _SYSTEM_PACKAGES,
    "libOpenGL": _SYSTEM_PACKAGES,
    "libgomp": _SYSTEM_PACKAGES,
}
# Packages that are not called what they are imported as.
_PACKAGES = {"rerun": "rerun-sdk", "cv2": "opencv-python-headless"}
# Without libOpenGL pymeshlab imports, prints a page of warnings and lacks half of its filters.
_NEEDS = {"pymeshlab": ("libGL.so.1", "libOpenGL.so.0")} if sys.platform == "linux" else {}


_OPEN3D_EXTRAS = ("open3d.visualization", "open3d.ml")


def import_library(name: str) -> ModuleType:
    """Import `name`; a missing package or system library becomes a DependencyError."""
    try:
        for library in _NEEDS.get(name, ()):
            ctypes.CDLL(library)
        if name == "open3d" and name not in sys.modules:
            return _open3d_without_extras()
        return importlib.import_module(name)
    except (ImportError, OSError) as error:
        found = str(error)
        package = _PACKAGES.get(name, name.split(".")[0])
        fix = next(
            (text for library, text in _FIXES.items() if library in found),
            f"pip install {package}, in the environment that runs brrp",
        )
        raise DependencyError(f"{name} does not load", found=found, fix=fix) from error


def _open3d_without_extras() -> ModuleType:
    """Open3D without its drawing and its data sets, which bring Plotly, Dash, pandas and
    scikit-learn: more than half of the time of its import. Who asks for them gets them still."""
    stubs = {name: ModuleType(name) for name in _OPEN3D_EXTRAS}
    sys.modules.update(stubs)
    try:
        o3d = importlib.import_module("open3d")
    finally:
        for name, stub in stubs.items():
            if sys.modules.get(name) is stub:
                del sys.modules[name]

    def later(name: str) -> Any:
        if f"open3d.{name}" in _OPEN3D_EXTRAS:
            return importlib.import_module(f"open3d.{name}")
        raise AttributeError(f"module 'open3d' has no attribute {name!r}")

    o3d.__getattr__ = later  # type: ignore[method-assign]
    return o3d


def import_open3d() -> Any:
    """Open3D, with its own chatter turned down to errors."""
    o3d = import_library("open3d")
    o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
    return o3d


@cache
def thread_pools() -> Any:
    """The threads of the libraries that are loaded, to be limited."""
    from threadpoolctl import ThreadpoolController

    # Made once: it searches the process for libraries. Open3D must be among them by then.
    import_open3d()
    return ThreadpoolController()


def one_openmp_thread() -> AbstractContextManager[object]:
    """Hold OpenMP to one thread: the threads of Open3D's RANSAC take turns at one random stream,
    and those of its ICP add in the order in which they end, so that a seed is not enough to repeat
    a result on several."""
    pools: AbstractContextManager[object] = thread_pools().limit(limits=1, user_api="openmp")
    return pools


# Open3D has one stream of random numbers for the whole process.
_DRAWING = Lock()


@contextmanager
def seeded_open3d(seed: int) -> Iterator[None]:
    """Draws of Open3D that hang on `seed` alone: no other thread draws meanwhile. Seeded right
    before, or an earlier draw in the process would change the result."""
    with _DRAWING, one_openmp_thread():
        import_open3d().utility.random.seed(seed)
        yield
