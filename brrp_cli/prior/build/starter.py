"""The starter prior: household shapes, built into the user's data folder on first use."""

from __future__ import annotations

import json
import logging
import sys
import tempfile
from pathlib import Path

import numpy as np

from brrp_cli.errors import PriorError
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.locate import starter_prior_path
from brrp_cli.prior.manifest import FILE, read_manifest
from brrp_cli.prior.parameters import BuildParameters
from brrp_cli.progress import quiet
from brrp_cli.shapes.household import household_shapes

log = logging.getLogger(__name__)


def starter_prior(workers: int | None = None) -> Path:
    """Folder of this version's starter prior, which is built if it is not there.

    Errors: those of `build_prior`.
    """
    path = starter_prior_path()
    if _is_ready(path):
        return path
    log.info("Building the starter prior, once: %s", path)
    with tempfile.TemporaryDirectory(prefix="brrp_shapes_") as folder:
        descriptions = write_shapes(Path(folder))
        build_prior(
            Path(folder),
            path,
            descriptions=descriptions,
            workers=workers,
            overwrite=True,
            progress=sys.stderr.isatty() and not quiet(),
        )
    return path


def write_shapes(folder: Path) -> Path:
    """Write each household shape, in its colour, as a PLY into `folder`; returns the file of their
    descriptions."""
    import trimesh

    shapes = household_shapes()
    for shape in shapes:
        painted = trimesh.Trimesh(
            shape.mesh.vertices,
            shape.mesh.faces,
            vertex_colors=np.tile([*shape.color, 255], (len(shape.mesh.vertices), 1)),
            process=False,
        )
        painted.export(folder / f"{shape.name}.ply")
    descriptions = folder / "descriptions.json"
    phrases = {shape.name: shape.description for shape in shapes}
    descriptions.write_text(json.dumps(phrases), encoding="utf-8")
    return descriptions


def _is_ready(path: Path) -> bool:
    """Whether a whole prior with today's parameters lies there."""
    if not (path / FILE).is_file():
        return False
    try:
        return read_manifest(path).parameters == BuildParameters().as_dict()
    except PriorError:
        # The builder replaces a damaged manifest, and says so where it will not.
        return False
