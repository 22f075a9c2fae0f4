"""Turns under which an object looks almost alike in depth."""

from __future__ import annotations

from functools import cache
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from brrp_cli.config import TurnConfig
from brrp_cli.geometry import as_transforms
from brrp_cli.prior.shape import StoredShape
from brrp_cli.registration.model import Model
from brrp_cli.registration.sdf_refinement import refine_to_sdf
from brrp_cli.registration.turns import about_main_axes, turns_about_itself, without_same
from brrp_cli.seeds import child_rng

Array = NDArray[np.float64]

# Of stored shapes, by what they were compared with: it takes as long as a step of the search.
_TURNS: WeakKeyDictionary[StoredShape, tuple[TurnConfig, Array]] = WeakKeyDictionary()


def turns_onto_itself(model: Model, config: TurnConfig) -> Array:
    """(K, 4, 4) motions of the model, turns by `config.apart` at least, that bring its surface back
    to within `config.itself` of itself, on average. Of an object that is held it is found once."""
    known = _TURNS.get(model.stored.shape)
    if known is not None and known[0] == config:
        return known[1]
    surface = model.surface[: config.surface_points]
    start = np.concatenate(
        [
            as_transforms(_every_turn(config)),
            about_main_axes(model.surface, config.turns, config.main_axes),
        ]
    )
    # Scanned things do not lie quite along the axes of their boxes.
    every = refine_to_sdf(start, surface, model, config.onto_itself, config.onto_itself_steps)
    moved = np.einsum("kij,nj->kni", every[:, :3, :3], surface) + every[:, None, :3, 3]
    off = np.abs(model.signed_distance(moved.reshape(-1, 3))).reshape(len(every), -1).mean(axis=1)
    good = (off < config.itself) & (turned_by(every, np.eye(4)) >= config.apart)
    found = every[good][np.argsort(off[good], kind="stable")]
    found = without_same(found, config.same_turn, config.same_shift)
    _TURNS[model.stored.shape] = config, found
    return found


@cache
def _every_turn(config: TurnConfig) -> Array:
    """(K, 3, 3): about the axes of the box, and any."""
    drawn = Rotation.random(config.any_turns, random_state=child_rng(0, "turned")).as_matrix()
    every = np.concatenate([turns_about_itself(config.turns), drawn])
    return np.asarray(every[turned_by(every, np.eye(3)) >= config.apart])


def turned_by(T: Array, other: Array) -> Array:
    """(K,) radians between rotations or similarities of one size (K, ...) and another."""
    R, S = T[:, :3, :3], other[:3, :3]
    square = (S**2).sum() / 3
    cosine = (np.einsum("kij,ij->k", R, S) / square - 1) / 2
    return np.asarray(np.arccos(np.clip(cosine, -1, 1)))
