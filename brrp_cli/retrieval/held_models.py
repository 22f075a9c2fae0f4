"""The models of stored objects that retrieval lays over what is seen, read and held in memory."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from threading import RLock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.retrieval import AlignmentConfig
from brrp_cli.geometry import similarity
from brrp_cli.prior.distance_field import DistanceField
from brrp_cli.prior.kept_parts import KeptParts, kept_parts
from brrp_cli.prior.shard import DISTANCES
from brrp_cli.prior.store import Prior
from brrp_cli.registration.glance import coarser
from brrp_cli.registration.model import BareModel

# What is read of each object.
PARTS = (
    "box",
    "surface",
    "surface_normals",
    "pose_T",
    f"{DISTANCES}/lower",
    f"{DISTANCES}/spacing",
    f"{DISTANCES}/values",
)
# Models that are held in memory, 0.14 MB each; those of them that were used last as they are
# computed with, 0.28 MB each; and coarser ones, 0.03 MB each.
HELD, READY, HELD_COARSELY = 1024, 128, 4096
# Models that are made coarser at a time; in use, one takes 0.25 MB.
AT_A_TIME = 64
# Objects of the largest prior whose models are kept beside it, 0.14 MB each.
KEPT = 2048


class HeldModels:
    """Those that were read last, or those of all objects as they are kept beside the prior."""

    def __init__(self, prior: Prior, config: AlignmentConfig) -> None:
        self._prior = prior
        self._config = config
        self._held: OrderedDict[str, BareModel] = OrderedDict()
        self._ready: OrderedDict[str, BareModel] = OrderedDict()
        self._kept: KeptParts | None = None
        self._sought = False
        # Objects of a frame are retrieved in several threads.
        self._reading = RLock()
        self._coarse: OrderedDict[str, BareModel] = OrderedDict()

    def of(self, names: Sequence[str]) -> list[BareModel]:
        """The models of objects of these names. Errors: PriorError."""
        with self._reading:
            self._read([name for name in names if name not in self._ready])
            found = [self._ready[name] for name in names]
            for name in names:
                self._ready.move_to_end(name)
            _let_go(self._ready, READY)
            return found

    def coarse(self, names: Sequence[str]) -> list[BareModel]:
        """The same, as `glance` needs them. Errors: PriorError."""
        points = self._config.glance.model_points
        with self._reading:
            new = [name for name in names if name not in self._coarse]
            if 2 * len(new) > len(self._prior.names):
                # As good as all have to be read, so they are kept for the next command.
                self._seek(make=True)
            for start in range(0, len(new), AT_A_TIME):
                some = new[start : start + AT_A_TIME]
                self._coarse |= {
                    name: coarser(model, points)
                    for name, model in zip(some, self.of(some), strict=True)
                }
            found = [self._coarse[name] for name in names]
            for name in names:
                self._coarse.move_to_end(name)
            _let_go(self._coarse, HELD_COARSELY)
            return found

    def _read(self, names: Sequence[str]) -> None:
        """Make models of these names ready."""
        if not names:
            return
        self._seek(make=False)
        points = self._config.search.fine_points
        if self._kept is not None:
            self._ready |= {name: bare_model(self._kept.of(name), points) for name in names}
            return
        new = [name for name in names if name not in self._held]
        for name, arrays in self._prior.parts(new, PARTS):
            self._held[name] = _with_values(bare_model(arrays, points), np.float16)
        for name in names:
            self._ready[name] = _with_values(self._held[name], np.float32)
            self._held.move_to_end(name)
        _let_go(self._held, HELD)

    def _seek(self, *, make: bool) -> None:
        """Look once for what is kept beside the prior, or make it."""
        done = self._kept is not None or (self._sought and not make)
        if done or len(self._prior.names) > KEPT:
            return
        self._sought = True
        self._kept = kept_parts(self._prior, PARTS, self._config.search.fine_points, make=make)
        if self._kept is not None:
            self._held.clear()


def _let_go(held: OrderedDict[str, BareModel], most: int) -> None:
    """Of what was not used for longest, until so many are left."""
    while len(held) > most:
        held.popitem(last=False)


def _with_values(model: BareModel, kind: type[np.floating]) -> BareModel:
    """With distances in another precision: they are kept in the one in which they are stored, half
    the memory of that in which they are computed with."""
    field = model.field
    return replace(model, field=replace(field, values=field.values.astype(kind)))


def bare_model(arrays: dict[str, NDArray[Any]], points: int) -> BareModel:
    """The model of an object's arrays (`PARTS`), with so many points of its surface."""
    lower, upper = arrays["box"]
    half = float((upper - lower).max() / 2)
    T_object_model = similarity(translation=(lower + upper) / 2)
    return BareModel(
        field=DistanceField(
            lower=arrays[f"{DISTANCES}/lower"],
            spacing=float(arrays[f"{DISTANCES}/spacing"][0]),
            values=arrays[f"{DISTANCES}/values"].astype(np.float32),
        ),
        half_extent=half,
        surface=arrays["surface"][:points].astype(np.float64) * half,
        normals=arrays["surface_normals"][:points].astype(np.float64),
        resting=[T @ T_object_model for T in arrays["pose_T"]],
    )
