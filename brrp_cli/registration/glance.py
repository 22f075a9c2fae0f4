"""A glance at how well a model could be placed, in a few milliseconds: no more than tells which of
a thousand are worth a search.

Colours, point pairs and size do not tell that of plain things: of random shapes that were seen in
full, some were beyond the 600th of 922 by those.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brrp_cli.config import SearchConfig
from brrp_cli.prior.distance_field import DistanceField
from brrp_cli.registration.begin import best_brought_nearer
from brrp_cli.registration.leaning_poses import resting_and_leaning
from brrp_cli.registration.model import BareModel
from brrp_cli.registration.verification import Verifier


def glance(model: BareModel, verifier: Verifier, config: SearchConfig) -> float:
    """The best coarse alignment score of the first placements after `begun_steps` steps."""
    T = resting_and_leaning(model, verifier.outline(config), config)
    _, scores = best_brought_nearer(T, model, verifier, config)
    return float(scores[0])


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
