"""A glance at how well a model could be placed, in a millisecond or two: no more than tells which
of a thousand are worth a search.

Colours, point pairs and size do not tell that of plain things: of random shapes that were seen in
full, some were beyond the 600th of 922 by those.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brrp_cli.config import SearchConfig
from brrp_cli.prior.distance_field import DistanceField
from brrp_cli.registration.begin import brought_nearer, coarse_score
from brrp_cli.registration.initial_poses import resting_over_the_middle
from brrp_cli.registration.leaning_poses import principal_poses
from brrp_cli.registration.model import BareModel
from brrp_cli.registration.verification import Verifier


def glance(model: BareModel, verifier: Verifier, config: SearchConfig) -> float:
    """The best coarse alignment score after the first steps, of the model resting on the plane in
    the middle of what is seen, and along its principal axes."""
    seen = verifier.outline(config)
    T = principal_poses(model, seen)
    if seen.footprint is not None:
        T = np.concatenate([resting_over_the_middle(model, seen.footprint, config), T])
    T = brought_nearer(
        T, model, verifier, config.begun_points, config.coarse_distance, config.begun_steps
    )
    return float(coarse_score(T, model, verifier, config, config.first_share).max())


def coarser(model: BareModel, points: int) -> BareModel:
    """With every second node of its distances, an eighth of the memory, and so many points."""
    field = model.field
    values = np.ascontiguousarray(field.values[::2, ::2, ::2])
    return replace(
        model,
        field=DistanceField(field.lower, 2 * field.spacing, values),
        surface=model.surface[:points].copy(),
        normals=model.normals[:points].copy(),
    )
