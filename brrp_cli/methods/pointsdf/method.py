"""PointSDF: a network trained on scenes of known objects, from each seen cloud to occupancy.

The occupancy version of the paper's experiments (see network.py for the source and the network),
whose surface lies at 0.3. No prior, no table: nothing but what was seen of each object goes in.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import PointSDFConfig
from brrp_cli.config.tables import changed
from brrp_cli.device import pick_device
from brrp_cli.files import sha256_file
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.geometry import as_points
from brrp_cli.inference.posterior import LOGISTIC_DEVIATION
from brrp_cli.methods.base import Setup
from brrp_cli.methods.coarse_to_fine import coarse_to_fine_volume
from brrp_cli.methods.configuration import as_record
from brrp_cli.methods.each_object import surfaced, too_few
from brrp_cli.methods.pointsdf.decoder_file import read_decoder, write_decoder
from brrp_cli.methods.pointsdf.farthest_points import farthest_points
from brrp_cli.methods.pointsdf.weights import OWN_WEIGHTS, Weights, load_weights
from brrp_cli.observation.borne import supporting_plane
from brrp_cli.observation.ray_samples import box_center
from brrp_cli.observation.strays import without_strays
from brrp_cli.observation.support_plane import Plane
from brrp_cli.progress import progress
from brrp_cli.reconstruction import (
    METRES,
    OK,
    Axes,
    ObjectReconstruction,
    Reconstruction,
)

if TYPE_CHECKING:
    import h5py

    from brrp_cli.hdf5 import SharedParts
    from brrp_cli.methods.pointsdf.network import Decoder, PointSDF

NAME = "pointsdf"
CHUNK = 16_384  # points that go through the network at once


@dataclass(frozen=True)
class PointSDFPosterior:
    """One object's occupancy; an OccupancyPosterior.

    decoder : shared by all objects of a frame; code : (C,) float32, what the encoder made of the
    object's cloud; center : (3,) metres, camera frame, of the cloud's bounding box; scale : metres
    of the decoder's unit
    """

    kind: ClassVar[str] = "pointsdf"

    decoder: Decoder
    code: NDArray[np.float32]
    center: NDArray[np.float64]
    scale: float
    config: PointSDFConfig

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) metres, camera frame."""
        return np.stack(
            [self.center - self.config.half_width, self.center + self.config.half_width]
        )

    def logits(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """What the network says (n,) at points (n, 3), metres, camera frame."""
        import torch

        device = next(self.decoder.parameters()).device
        queries = ((np.asarray(points, dtype=np.float64) - self.center) / self.scale).astype("f4")
        found = np.empty(len(queries), dtype=np.float32)
        with torch.inference_mode():
            code = torch.from_numpy(self.code)[None].to(device)
            for start in range(0, len(queries), CHUNK):
                part = torch.from_numpy(queries[None, start : start + CHUNK]).to(device)
                found[start : start + CHUNK] = self.decoder(code, part)[0].cpu().numpy()
        return found

    def probability(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Occupancy probability (n,) at points (n, 3), metres, camera frame; 0 outside `bounds`."""
        points = as_points(points)
        within = ((points >= self.bounds[0]) & (points <= self.bounds[1])).all(axis=1)
        result = np.zeros(len(points), dtype=np.float32)
        result[within] = _sigmoid(self.logits(points[within]))
        return result

    def probability_volume(self, axes: Axes) -> NDArray[np.float32]:
        """`probability` (nx, ny, nz) on a grid of camera-frame coordinates, metres; between
        nodes where nothing is likely."""
        return coarse_to_fine_volume(self.probability, axes, self.config.grid)

    def uncertainty(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Variance (n,) of occupancy, p (1 - p): all that a single network can say."""
        p = self.probability(points)
        return p * (1 - p)

    @property
    def surface_unit(self) -> str:
        """Unit of `surface_uncertainty`."""
        return METRES

    def surface_uncertainty(self, vertices: NDArray[np.floating]) -> NDArray[np.float32]:
        """Standard deviation (n,), metres, of the surface's place at its vertices (n, 3).

        Occupancy is taken to be a logistic function of the way across the surface: the more slowly
        it falls there, the less is known where the surface is.
        """
        size, largest = self.config.difference_step, self.config.largest_deviation
        slope = [
            (self.logits(vertices + step) - self.logits(vertices - step)) / (2 * size)
            for step in np.eye(3) * size
        ]
        steepness = np.maximum(np.linalg.norm(slope, axis=0), LOGISTIC_DEVIATION / largest)
        return np.asarray(LOGISTIC_DEVIATION / steepness, dtype=np.float32)

    def write(self, group: h5py.Group, shared: SharedParts) -> None:
        """Attributes decoder (its name among what is shared), center (3), scale, config (JSON);
        code (C,) float32."""
        group.attrs["decoder"] = shared.write("decoder", self.decoder, write_decoder)
        group.attrs["center"] = self.center
        group.attrs["scale"] = self.scale
        group.attrs["config"] = json.dumps(asdict(self.config))
        group.create_dataset("code", data=self.code, chunks=self.code.shape, fletcher32=True)

    @classmethod
    def read(cls, group: h5py.Group, shared: SharedParts) -> PointSDFPosterior:
        """What `write` wrote, on the CPU. Errors: KeyError, ValueError."""
        decoder = shared.read(str(group.attrs["decoder"]), read_decoder)
        code = np.asarray(group["code"], dtype=np.float32)
        if code.shape != (decoder.config.code,):
            raise ValueError(f"a code of shape {code.shape}, not ({decoder.config.code},)")
        return PointSDFPosterior(
            decoder,
            code,
            np.asarray(group.attrs["center"], dtype=np.float64),
            float(group.attrs["scale"]),
            changed(PointSDFConfig(), json.loads(group.attrs["config"]), group.name),
        )


def run(frame: Frame, setup: Setup) -> Reconstruction:
    """Every object of the frame; nothing is drawn but the plane's candidates."""
    config = setup.config
    assert isinstance(config, PointSDFConfig)
    weights = setup.weights or OWN_WEIGHTS
    device = pick_device(setup.device)
    digest = sha256_file(weights)
    loaded = _loaded(weights, digest, device)
    cleaned = without_strays(frame, config.strays)
    found = reconstruct_pointsdf(cleaned, loaded.network, config)
    return Reconstruction(
        frame=frame,
        objects=[surfaced(item, config.surface) for item in progress(found, "surfaces")],
        plane=_plane(frame, config, setup.seed),
        method=NAME,
        retriever=None,
        prior_path=None,
        prior_digest=None,
        configuration={
            **as_record(config),
            "network": asdict(loaded.network.config),
            "weights": {
                "path": str(weights),
                "sha256": digest,
                "training": loaded.training,
            },
        },
        seed=setup.seed,
        device=device,
    )


def _plane(frame: Frame, config: PointSDFConfig, seed: int) -> Plane | None:
    """The network asks for no table; the picture does, to show the scene upright."""
    background = frame.points[frame.valid & (frame.segmap == BACKGROUND)]
    seen = frame.points[frame.valid & (frame.segmap != BACKGROUND)]
    if not len(seen):
        return None
    return supporting_plane(background, seen, config.observation, seed, box_center(seen))


@lru_cache(maxsize=4)
def _loaded(weights: Path, digest: str, device: str) -> Weights:
    """Read once for all frames of a process, while the file stays the same."""
    found = load_weights(weights)
    found.network.to(device)
    return found


def reconstruct_pointsdf(
    frame: Frame, network: PointSDF, config: PointSDFConfig
) -> list[ObjectReconstruction]:
    """Occupancy of every object of the frame, by id, ascending; all clouds are encoded together.

    It runs where the network is; nothing is drawn. `seconds` holds each object's equal share.
    """
    import torch

    start = perf_counter()
    found, clouds = [], []
    for object_id in frame.object_ids:
        points = frame.object_points(object_id)
        if len(points) < config.min_points:
            found.append(too_few(object_id, len(points), config.min_points))
            continue
        item = ObjectReconstruction(object_id, OK, n_points=len(points))
        found.append(item)
        item.observed, item.center = points, box_center(points)
        clouds.append(farthest_points(points - item.center, network.config.points))
    seen = [item for item in found if item.observed is not None]
    if not seen:
        return found
    observation = (perf_counter() - start) / len(seen)
    start = perf_counter()
    device = next(network.parameters()).device
    with torch.inference_mode():
        scaled = torch.from_numpy(np.stack(clouds) / np.float32(network.config.scale))
        codes = network.encode(scaled.to(device)).cpu().numpy()
    inference = (perf_counter() - start) / len(seen)
    for item, code in zip(seen, codes, strict=True):
        assert item.center is not None
        item.posterior = PointSDFPosterior(
            network.decoder, code, item.center, network.config.scale, config
        )
        item.seconds = {"observation": observation, "inference": inference}
    return found


def _sigmoid(logits: NDArray[np.float32]) -> NDArray[np.float32]:
    from scipy.special import expit

    return np.asarray(expit(logits), dtype=np.float32)
