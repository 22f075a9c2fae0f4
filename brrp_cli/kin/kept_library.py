"""The library of a prior, made once: it is held in memory, and kept beside the prior.

It is kept in PRIOR/kin/library-XXXXXXXXXXXXXXXX.npz, named after what it is made from: the prior's
digest and the numbers of `KinConfig` that decide it. It is no part of what the prior's manifest
vouches for: deleting it costs a few seconds.
"""

from __future__ import annotations

import hashlib
import json
import logging
import zipfile
from collections import OrderedDict
from dataclasses import asdict, fields
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from brrp_cli.config import KinConfig
from brrp_cli.errors import OutputError
from brrp_cli.files import atomic_path
from brrp_cli.kin.library import Fields, Library, library_of_prior
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

log = logging.getLogger(__name__)


def kin_library(prior: Prior, config: KinConfig) -> Library:
    """That of a prior: from memory, as it was kept, or made. Errors: PriorError."""
    path = kept_path(prior, config)
    with _MAKING:
        library = _MADE.pop(path, None) or _read(path)
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
    digest = hashlib.sha256(json.dumps(made_from).encode()).hexdigest()
    return prior.path / FOLDER / f"library-{digest[:16]}.npz"


def _read(path: Path) -> Library | None:
    """The library as it was kept; None where there is none, or a damaged one."""
    if not path.is_file():
        return None
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays: dict[str, Any] = {name: file[name] for name in file.files}
        of_fields = {each.name: arrays.pop(_PREFIX + each.name) for each in fields(Fields)}
        names, reach = arrays.pop("names").tolist(), float(arrays.pop("reach"))
        return Library(names=names, fields=Fields(**of_fields), reach=reach, **arrays)
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        log.info("The shapes kept in %s are damaged and are made anew: %s", path, error)
        return None


def _keep(library: Library, path: Path) -> None:
    """Write it in the place of what was kept before, or say why not: a prior that cannot be written
    can still be used."""
    arrays = {_PREFIX + each.name: getattr(library.fields, each.name) for each in fields(Fields)}
    arrays |= {
        each.name: np.asarray(getattr(library, each.name))
        for each in fields(Library)
        if each.name != "fields"
    }
    try:
        with atomic_path(path) as partial, partial.open("wb") as stream:
            np.savez(stream, **arrays)
        for other in path.parent.glob("library-*.npz"):
            if other != path:
                other.unlink(missing_ok=True)
    except (OutputError, OSError) as error:
        log.info("Shapes for kin cannot be kept in %s: %s", path.parent, error)
