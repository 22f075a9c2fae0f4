"""The posterior of one object from its weighed hypotheses: placed shapes, and the completion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.completion.completed_mean import (
    empty_space,
    logits_within,
    network_grid,
    shell_of,
)
from brrp_cli.completion.revolution import round_logits
from brrp_cli.completion.revolution_axis import Axis
from brrp_cli.completion.roundness import axis_of
from brrp_cli.completion.seen_surface import SeenSurface, joined
from brrp_cli.completion.standing import on_others, standing
from brrp_cli.completion.visible_part import VisiblePart, visible_part
from brrp_cli.config import HypothesesConfig, MeanConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior, MeanFunction
from brrp_cli.inference.infer_hypotheses import Problem, infer_correction
from brrp_cli.inference.mean_grid import MeanGrid, grid_over
from brrp_cli.inference.placed_shape import PlacedShape
from brrp_cli.inference.posterior import LOGISTIC_DEVIATION
from brrp_cli.methods.earlier_views import ALONE, EarlierViews, Guess
from brrp_cli.observation.ray_samples import ObjectObservation
from brrp_cli.observation.sensor_noise import depth_deviation
from brrp_cli.observation.soft_samples import NO_SAMPLES, soft_samples
from brrp_cli.observation.support_plane import Plane
from brrp_cli.registration.pose_covariance import pose_covariance
from brrp_cli.registration.pose_search import Hypothesis
from brrp_cli.registration.seen_mask import SeenMask
from brrp_cli.seeds import child_seed

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shown:
    """What the frame shows of an object for its completion. observation : with the points of the
    smoothed surface; axis : about which it is round, None if it is not"""

    surface: SeenSurface
    observation: ObjectObservation
    part: VisiblePart
    axis: Axis | None


def shown_of(
    surface: SeenSurface,
    observation: ObjectObservation,
    plane: Plane | None,
    surface_cell: float,
    config: HypothesesConfig,
) -> Shown:
    """surface_cell : metres, of the grid in which samples of the seen surface are thinned"""
    frame, object_id = surface.frame, observation.object_id
    observation = observation.with_points(frame.object_points(object_id), surface_cell)
    part = visible_part(observation.points, frame, object_id, plane, config.completion)
    axis = axis_of(part.seen, part.normals, part.up, config.mean.revolution)
    return Shown(surface, observation, part, axis)


def infer_object(
    observation: ObjectObservation,
    frame: Frame,
    plane: Plane | None,
    shown: Callable[[], Shown],
    wave: float,
    shapes: list[PlacedShape],
    weights: Array,
    config: HypothesesConfig,
    views: EarlierViews,
    *,
    trusted: bool,
    seed: int,
    device: str,
) -> tuple[HypothesisPosterior, Guess | None]:
    """The posterior, camera frame, and what the completion's network thinks of this view alone;
    None where the completion weighs nothing.

    shown : which the completion needs
    wave : metres, as in `reconstruct_by_hypotheses`; weights : (C,) of the shapes and, where there
    is one more, of the completion; views : of earlier frames, none of a frame that stands alone
    trusted : whether what this frame measured corrects the shapes
    """
    own = shown() if len(shapes) < len(weights) else None
    if own is not None:
        frame, observation = own.surface.frame, own.observation
    extents: list[Array] = [observation.points.astype(np.float64), *views.points()]
    extents += [shape.bounds for shape in shapes]
    if own is not None:
        extents.append(own.part.extent)
        if own.axis is not None:
            extents.append(own.axis.turned(own.part.seen, config.mean.revolution.turns))
    extent = np.concatenate(extents)
    margin = config.map.margin
    box = np.stack([extent.min(axis=0) - margin, extent.max(axis=0) + margin])
    means: list[MeanFunction] = list(shapes)
    guess = None
    if own is not None:
        minor = weights[-1] < config.mean.minor
        nodes = config.mean.minor_nodes if minor else config.mean.nodes
        completed, guess = _completed(own, box, plane, replace(config.mean, nodes=nodes), views)
        means.append(completed)
    stiffness = np.ones(len(means))
    stiffness[: len(shapes)] = config.map.stiffness
    samples = NO_SAMPLES
    if trusted:
        samples = soft_samples(observation, frame, config.map.behind, config.sensor)
    samples = views.joined(samples)
    deviation = config.sensor.sure * depth_deviation(observation.center[2:], config.sensor)[0]
    posterior = infer_correction(
        Problem(samples, tuple(means), weights, stiffness, deviation, box, wave),
        config.map,
        seed=child_seed(seed, observation.object_id),
        device=device,
    )
    return posterior, guess


def placed_shape(
    hypothesis: Hypothesis,
    observed: NDArray[np.float32],
    wave: float,
    config: HypothesesConfig,
    views: EarlierViews = ALONE,
    alike: Array | None = None,
    mask: SeenMask | None = None,
) -> PlacedShape:
    """Where `hypothesis` puts it; alike : (K, 4, 4) T_cam_model of placements that are as probable;
    mask : of the object, where depth shows too little of it.
    The less the frame says for the placement, and the less it fixes its pose, the softer its
    surface."""
    stored, mean = hypothesis.model.stored, config.mean
    covariance = pose_covariance(
        hypothesis.T_cam_model,
        hypothesis.model,
        observed,
        wave,
        config.sensor,
        views.points(),
        mask,
    )
    doubt = mean.doubt * max(0.0, mean.sure - hypothesis.alignment_score)
    shape = PlacedShape(
        stored.name,
        stored.shape,
        hypothesis.T_cam_object,
        mean.width,
        mean.limit,
        covariance,
        exact=mean.exact,
    )
    if alike is not None:
        shape = replace(shape, alike=alike @ hypothesis.model.T_model_object)
    by_pose = float(np.sqrt(np.mean(shape.deviations**2))) / LOGISTIC_DEVIATION
    return replace(shape, width=float(np.hypot(mean.width, by_pose)) + doubt)


def _completed(
    shown: Shown,
    box: Array,
    plane: Plane | None,
    config: MeanConfig,
    views: EarlierViews,
) -> tuple[MeanGrid, Guess]:
    """From all views, and what the network thinks of the present one."""
    part, axis = shown.part, shown.axis
    lower, spacing, nodes = grid_over(box, config.nodes)
    points = nodes.reshape(-1, 3)
    empty = empty_space(points, part.frame, part.object_id, plane, config)
    empty = (empty | views.empty(points, config)).reshape(nodes.shape[:3])
    alone = network_grid(nodes, empty, part, config)
    shell, left = shell_of(nodes, config), nodes[~empty]
    bounds = [shown.surface.bounds(left, shell, config), *views.bounds(left, shell, config)]
    every = alone.copy()
    every[~empty] = views.averaged(alone[~empty], left)
    if axis is not None:
        every = round_logits(axis, nodes, empty, every, part, shell, config)
    # After the turn: what is round stands as a whole.
    if plane is not None and config.standing.enabled and not on_others(part, config.standing):
        thought = np.clip(every[~empty], -config.limit, config.limit)
        heights = plane.signed_distance(left)
        every[~empty] = standing(thought, heights, spacing, config.standing)
    logits = logits_within(every, empty, joined(bounds), config)
    guess = Guess(lower, spacing, np.where(empty, np.nan, alone).astype(np.float16))
    return MeanGrid(lower, spacing, logits, outside=-config.limit), guess
