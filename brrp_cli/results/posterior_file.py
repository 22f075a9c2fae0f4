"""posterior.h5: the posterior of every object of a frame, to be asked again later.

    /                   schema (int), frame ("camera"), units ("metre")
    /objects/ID         center (3), reach, hinge_lower (3), hinge_counts (3), hinge_spacing,
                        feature_floor; with prior means also mean_lower (3), mean_spacing, outside
    /objects/ID/weights (P, H + 1) float32
    /objects/ID/mean    (C, nx, ny, nz) float16, logits, with prior means
    /objects/ID/which   (P,) int64, the mean of each particle, with prior means

These are BRRP's particles; for what V-PRISM and PointSDF leave see `posterior_file.py` in
`brrp_cli/methods/vprism/` and `brrp_cli/methods/pointsdf/`.
Points are asked in the camera frame, metres, whatever frame the meshes were written in.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.errors import BrrpError
from brrp_cli.hdf5 import hdf5_bytes
from brrp_cli.inference.hinge import HingeGrid
from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior
from brrp_cli.inference.posterior import HilbertPosterior
from brrp_cli.inference.prior_mean import PriorMeanGrid
from brrp_cli.methods.pointsdf import posterior_file as pointsdf_file
from brrp_cli.methods.pointsdf.method import PointSDFPosterior
from brrp_cli.methods.vprism.method import VPrismPosterior
from brrp_cli.methods.vprism.posterior_file import read_map, read_object, write_map, write_object
from brrp_cli.reconstruction import OccupancyPosterior

if TYPE_CHECKING:
    import h5py

SCHEMA = 2
MAP, DECODER = "map", "decoder"


def save_posteriors(posteriors: Mapping[int, OccupancyPosterior], path: Path) -> None:
    """Write the posteriors of a frame's objects; the same posteriors give the same bytes.

    V-PRISM's objects share the map of one frame, PointSDF's a decoder, which is written once.
    """

    def fill(file: h5py.File) -> None:
        file.attrs.update({"schema": SCHEMA, "frame": "camera", "units": "metre"})
        objects = file.create_group("objects")
        for object_id, posterior in posteriors.items():
            group = objects.create_group(str(object_id))
            if isinstance(posterior, VPrismPosterior):
                if MAP not in file:
                    write_map(file.create_group(MAP), posterior.scene)
                write_object(group, posterior)
            elif isinstance(posterior, PointSDFPosterior):
                if DECODER not in file:
                    pointsdf_file.write_decoder(file.create_group(DECODER), posterior.decoder)
                pointsdf_file.write_object(group, posterior)
            elif isinstance(posterior, HilbertPosterior):
                _write(group, posterior)
            elif isinstance(posterior, HypothesisPosterior):
                _write(group, posterior.correction)
                _write_mean(group, posterior)
            else:
                raise TypeError(f"no file format for {type(posterior).__name__}")

    path.write_bytes(hdf5_bytes(fill))


def _write(group: h5py.Group, posterior: HilbertPosterior) -> None:
    group.attrs["center"] = posterior.center
    group.attrs["reach"] = posterior.reach
    group.attrs["hinge_lower"] = posterior.grid.lower
    group.attrs["hinge_counts"] = posterior.grid.counts
    group.attrs["hinge_spacing"] = posterior.grid.spacing
    group.attrs["feature_floor"] = posterior.grid.floor
    group.create_dataset(
        "weights",
        data=posterior.weights,
        chunks=posterior.weights.shape,
        fletcher32=True,
    )


def _write_mean(group: h5py.Group, posterior: HypothesisPosterior) -> None:
    mean = posterior.mean
    group.attrs["mean_lower"] = mean.lower
    group.attrs["mean_spacing"] = mean.spacing
    group.attrs["outside"] = mean.outside
    group.create_dataset(
        "mean",
        data=mean.values,
        chunks=(1, *mean.values.shape[1:]),
        compression="gzip",
        shuffle=True,
        fletcher32=True,
    )
    group.create_dataset(
        "which", data=posterior.which, chunks=posterior.which.shape, fletcher32=True
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
            if DECODER in file:
                decoder = pointsdf_file.read_decoder(file[DECODER])
                return {i: pointsdf_file.read_object(g, decoder) for i, g in groups.items()}
            return {i: _read(group) for i, group in groups.items()}
    except (OSError, KeyError, ValueError) as error:
        raise BrrpError(
            "The posterior file cannot be read",
            where=path,
            found=error,
            fix="run `brrp reconstruct` again",
        ) from error


def _read(group: h5py.Group) -> OccupancyPosterior:
    attributes = group.attrs
    x, y, z = (float(v) for v in attributes["hinge_lower"])
    nx, ny, nz = (int(n) for n in attributes["hinge_counts"])
    particles = HilbertPosterior(
        weights=np.asarray(group["weights"], dtype=np.float32),
        center=np.asarray(attributes["center"], dtype=np.float64),
        grid=HingeGrid(
            (x, y, z),
            (nx, ny, nz),
            float(attributes["hinge_spacing"]),
            float(attributes["feature_floor"]),
        ),
        reach=float(attributes["reach"]),
    )
    if "mean" not in group:
        return particles
    mean = PriorMeanGrid(
        lower=np.asarray(attributes["mean_lower"], dtype=np.float64),
        spacing=float(attributes["mean_spacing"]),
        values=np.asarray(group["mean"], dtype=np.float16),
        outside=float(attributes["outside"]),
    )
    return HypothesisPosterior(mean, np.asarray(group["which"], dtype=np.int64), particles)
