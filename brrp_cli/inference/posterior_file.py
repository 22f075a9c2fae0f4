"""posterior.h5: the posterior of every object of a frame, to be asked again later.

    /                   schema (int), frame ("camera"), units ("metre")
    /objects/ID         center (3), reach, hinge_half_width, feature_floor, hinges_per_axis
    /objects/ID/weights (P, H + 1) float32

These are BRRP's particles; for what V-PRISM leaves see `brrp_cli/methods/vprism_file.py`.
Points are asked in the camera frame, metres, whatever frame the meshes were written in.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.errors import BrrpError
from brrp_cli.inference.hinge import HingeGrid
from brrp_cli.inference.posterior import HilbertPosterior
from brrp_cli.methods.base import OccupancyPosterior
from brrp_cli.methods.vprism import VPrismPosterior
from brrp_cli.methods.vprism_file import read_map, read_object, write_map, write_object

if TYPE_CHECKING:
    import h5py

SCHEMA = 1
MAP = "map"


def save_posteriors(posteriors: Mapping[int, OccupancyPosterior], path: Path) -> None:
    """Write the posteriors of a frame's objects; the same posteriors give the same bytes.

    V-PRISM's objects share the map of one frame, which is written once.
    """
    import h5py

    with h5py.File(path, "w") as file:
        file.attrs.update({"schema": SCHEMA, "frame": "camera", "units": "metre"})
        objects = file.create_group("objects")
        for object_id, posterior in posteriors.items():
            group = objects.create_group(str(object_id))
            if isinstance(posterior, VPrismPosterior):
                if MAP not in file:
                    write_map(file.create_group(MAP), posterior.scene)
                write_object(group, posterior)
            elif isinstance(posterior, HilbertPosterior):
                _write(group, posterior)
            else:
                raise TypeError(f"no file format for {type(posterior).__name__}")


def _write(group: h5py.Group, posterior: HilbertPosterior) -> None:
    group.attrs["center"] = posterior.center
    group.attrs["reach"] = posterior.reach
    group.attrs["hinges_per_axis"] = posterior.grid.per_axis
    group.attrs["hinge_half_width"] = posterior.grid.half_width
    group.attrs["feature_floor"] = posterior.grid.floor
    group.create_dataset(
        "weights",
        data=posterior.weights,
        chunks=posterior.weights.shape,
        fletcher32=True,
    )


def open_posterior(path: str | Path) -> dict[int, OccupancyPosterior]:
    """Posteriors by object id: `open_posterior("out/posterior.h5")[3].probability(points)`.

    Errors: BrrpError when the file is missing, damaged or of a newer schema.
    """
    import h5py

    try:
        with h5py.File(path, "r") as file:
            found = file.attrs.get("schema")
            if found != SCHEMA:
                raise BrrpError(
                    "The posterior file has another schema",
                    where=path,
                    expected=SCHEMA,
                    found=found,
                    fix="read it with the version of brrp that wrote it",
                )
            groups = {int(name): group for name, group in file["objects"].items()}
            if MAP in file:
                scene = read_map(file[MAP])
                return {i: read_object(group, scene) for i, group in groups.items()}
            return {i: _read(group) for i, group in groups.items()}
    except (OSError, KeyError, ValueError) as error:
        raise BrrpError(
            "The posterior file cannot be read",
            where=path,
            found=error,
            fix="run `brrp reconstruct` again",
        ) from error


def _read(group: h5py.Group) -> HilbertPosterior:
    attributes = group.attrs
    return HilbertPosterior(
        weights=np.asarray(group["weights"], dtype=np.float32),
        center=np.asarray(attributes["center"], dtype=np.float64),
        grid=HingeGrid(
            int(attributes["hinges_per_axis"]),
            float(attributes["hinge_half_width"]),
            float(attributes["feature_floor"]),
        ),
        reach=float(attributes["reach"]),
    )
