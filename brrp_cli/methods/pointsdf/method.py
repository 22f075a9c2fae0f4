"""PointSDF: a network trained on scenes of known objects, from each seen cloud to occupancy.

The occupancy version of the paper's experiments (see network.py for the source and the network),
whose surface lies at 0.3. No prior, no table: nothing but what was seen of each object goes in.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import PointSDFConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.methods.coarse_to_fine import coarse_to_fine_volume
from brrp_cli.methods.pointsdf.farthest_points import farthest_points
from brrp_cli.observation.ray_samples import box_center
from brrp_cli.reconstruction import METRES, OK, TOO_FEW_POINTS, Axes, ObjectReconstruction

if TYPE_CHECKING:
    from brrp_cli.methods.pointsdf.network import Decoder, PointSDF

# A logistic distribution's standard deviation over its scale, and the scale of a surface whose
# logit has a gradient is one over that.
LOGISTIC = np.pi / np.sqrt(3)
LARGEST = 0.05  # metres; no surface is less certain than this
STEP = 0.001  # metres, of difference quotients
CHUNK = 16_384  # points that go through the network at once


@dataclass(frozen=True)
class PointSDFPosterior:
    """One object's occupancy; an OccupancyPosterior.

    decoder : shared by all objects of a frame; code : (C,) float32, what the encoder made of the
    object's cloud; center : (3,) metres, camera frame, of the cloud's bounding box; scale : metres
    of the decoder's unit
    """

    decoder: Decoder
    code: NDArray[np.float32]
    center: NDArray[np.float64]
    scale: float
    half_width: float

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) metres, camera frame."""
        return np.stack([self.center - self.half_width, self.center + self.half_width])

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
        points = np.asarray(points)
        within = ((points >= self.bounds[0]) & (points <= self.bounds[1])).all(axis=1)
        result = np.zeros(len(points), dtype=np.float32)
        result[within] = _sigmoid(self.logits(points[within]))
        return result

    def probability_volume(self, axes: Axes) -> NDArray[np.float32]:
        """`probability` (nx, ny, nz) on a grid of camera-frame coordinates, metres; between
        nodes where nothing is likely."""
        return coarse_to_fine_volume(self.probability, axes)

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
        slope = [
            (self.logits(vertices + step) - self.logits(vertices - step)) / (2 * STEP)
            for step in np.eye(3) * STEP
        ]
        steepness = np.maximum(np.linalg.norm(slope, axis=0), LOGISTIC / LARGEST)
        return np.asarray(LOGISTIC / steepness, dtype=np.float32)


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
        item = ObjectReconstruction(object_id, OK, n_points=len(points))
        found.append(item)
        if len(points) < config.min_points:
            item.status = TOO_FEW_POINTS
            item.message = f"{len(points)} points with depth, {config.min_points} are needed"
            continue
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
            network.decoder, code, item.center, network.config.scale, config.half_width
        )
        item.seconds = {"observation": observation, "inference": inference}
    return found


def _sigmoid(logits: NDArray[np.float32]) -> NDArray[np.float32]:
    from scipy.special import expit

    return np.asarray(expit(logits), dtype=np.float32)
