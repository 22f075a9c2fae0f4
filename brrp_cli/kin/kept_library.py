"""The library of a prior, made once: it is held in memory, and kept beside the prior.

It is kept in PRIOR/kin/library-XXXXXXXXXXXXXXXX.npz, named after what it is made from: the prior's
digest and the numbers of `KinConfig` that decide it. It is no part of what the prior's manifest
vouches for: deleting it costs a few seconds.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import asdict, fields
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import KinConfig
from brrp_cli.kin.library import Fields, Library, library_of_prior
from brrp_cli.prior.beside import keep_beside, path_beside, read_beside
from brrp_cli.prior.store import Prior

FOLDER = "kin"
# Of the way in which a library is made: what another version kept is made anew.
VERSION = 1
DECIDING = (
    "objects",
    "poses",
    "least_pose",
    "nodes",
    "reach",
    "surface_points",
    "box_turns",
    "hollow_clear",
)
# What the arrays of the file are called where they are of `Library.fields`.
_PREFIX = "fields_"

# Libraries that are held in memory.
HELD = 2

_MADE: OrderedDict[Path, Library] = OrderedDict()
_MAKING = Lock()


def kin_library(prior: Prior, config: KinConfig) -> Library:
    """That of a prior: from memory, as it was kept, or made. Errors: PriorError."""
    path = kept_path(prior, config)
    with _MAKING:
        library = _MADE.pop(path, None) or read_beside(path, _of_arrays)
        if library is None:
            library = library_of_prior(prior, config)
            _keep(library, path)
        _MADE[path] = library
        if len(_MADE) > HELD:
            _MADE.popitem(last=False)
        return library


def kept_path(prior: Prior, config: KinConfig) -> Path:
    """Where the library of this prior is kept."""
    told = asdict(config)
    made_from = [VERSION, prior.digest, [told[name] for name in DECIDING]]
    return path_beside(prior.path / FOLDER, "library", made_from)


def _of_arrays(arrays: dict[str, NDArray[Any]]) -> Library:
    """The library of the arrays that `_keep` kept."""
    of_fields = {each.name: arrays.pop(_PREFIX + each.name) for each in fields(Fields)}
    names, reach = arrays.pop("names").tolist(), float(arrays.pop("reach"))
    return Library(names=names, fields=Fields(**of_fields), reach=reach, **arrays)


def _keep(library: Library, path: Path) -> None:
    arrays = {_PREFIX + each.name: getattr(library.fields, each.name) for each in fields(Fields)}
    arrays |= {
        each.name: np.asarray(getattr(library, each.name))
        for each in fields(Library)
        if each.name != "fields"
    }
    keep_beside(path, arrays)
