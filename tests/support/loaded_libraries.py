"""Open3D as brrp loads it, for a process that imports this before anything else."""

from brrp_cli.dependencies import import_open3d

import_open3d()
