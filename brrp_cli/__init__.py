"""brrp: from one segmented RGBD frame to a closed mesh of every object, and how sure that is.

from brrp_cli import load_frame, open_prior, reconstruct
result = reconstruct(load_frame("frame.npz"), open_prior("prior/"))
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from brrp_cli.version import __version__

if TYPE_CHECKING:
    from brrp_cli.api import open_result as open_result
    from brrp_cli.api import reconstruct as reconstruct
    from brrp_cli.config import preset as preset
    from brrp_cli.errors import BrrpError as BrrpError
    from brrp_cli.errors import FrameError as FrameError
    from brrp_cli.frames.build import make_frame as make_frame
    from brrp_cli.frames.npz import load_frame as load_frame
    from brrp_cli.frames.readers import read_frame as read_frame
    from brrp_cli.grasping.gripper_file import open_gripper as open_gripper
    from brrp_cli.grasping.plan import plan_grasps as plan_grasps
    from brrp_cli.methods.config_file import load_config as load_config
    from brrp_cli.methods.posterior_file import open_posterior as open_posterior
    from brrp_cli.prior.store import open_prior as open_prior
    from brrp_cli.reconstruction import Reconstruction as Reconstruction
    from brrp_cli.results.write import write_results as write_results
    from brrp_cli.segmentation.segment import segment as segment
    from brrp_cli.session import Reconstructor as Reconstructor

# Names are imported when they are used, so that `brrp --help` does not wait for torch.
_HOMES = {
    "BrrpError": "brrp_cli.errors",
    "FrameError": "brrp_cli.errors",
    "Reconstruction": "brrp_cli.reconstruction",
    "Reconstructor": "brrp_cli.session",
    "load_config": "brrp_cli.methods.config_file",
    "load_frame": "brrp_cli.frames.npz",
    "make_frame": "brrp_cli.frames.build",
    "open_gripper": "brrp_cli.grasping.gripper_file",
    "open_posterior": "brrp_cli.methods.posterior_file",
    "open_prior": "brrp_cli.prior.store",
    "open_result": "brrp_cli.api",
    "plan_grasps": "brrp_cli.grasping.plan",
    "preset": "brrp_cli.config",
    "read_frame": "brrp_cli.frames.readers",
    "reconstruct": "brrp_cli.api",
    "segment": "brrp_cli.segmentation.segment",
    "write_results": "brrp_cli.results.write",
}

__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'brrp_cli' has no attribute {name!r}")
