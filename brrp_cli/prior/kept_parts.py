"""Some arrays of all of a prior's objects in one file beside it.

In its shard every array of an object is compressed and has checksums of its own: 10 ms an object.
Who needs all objects reads them once, and from one file in all later commands, to the same bytes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.prior.beside import keep_beside, path_beside, read_beside
from brrp_cli.prior.store import Prior

Arrays = dict[str, NDArray[Any]]

# Of the way in which they are kept: what another version kept is made anew.
VERSION = 1
_SHAPES = " shapes"


class KeptParts:
    """Arrays of all objects, one object after the other.

    packed : of each of the arrays `keys`, all its numbers (n,), and under its name and " shapes"
    the shapes (O, d). Errors: KeyError, ValueError where it is not of these objects and arrays.
    """

    def __init__(self, names: Sequence[str], keys: Sequence[str], packed: Arrays) -> None:
        self._rows = {name: row for row, name in enumerate(names)}
        self._packed = packed
        self._ends = {key: np.cumsum(np.prod(packed[key + _SHAPES], axis=1)) for key in keys}
        for key, ends in self._ends.items():
            if len(ends) != len(names) or len(packed[key]) != ends[-1]:
                raise ValueError(f"{key} does not have the numbers of {len(names)} objects")

    def of(self, name: str) -> Arrays:
        """The arrays of one object, not to be changed."""
        row = self._rows[name]
        found = {}
        for key, ends in self._ends.items():
            begin = ends[row - 1] if row else 0
            shape = self._packed[key + _SHAPES][row]
            found[key] = self._packed[key][begin : ends[row]].reshape(shape)
        return found


def kept_parts(
    prior: Prior, keys: Sequence[str], first: int, *, make: bool = True
) -> KeptParts | None:
    """Some arrays (prior/shard.py names them) of all of a prior's objects, as they were kept, or
    made and kept; None where they would have to be made and are not to be.

    first : rows of its surface points and their normals that are kept. Errors: PriorError.
    """
    made_from = [VERSION, prior.digest, list(keys), first]
    path = path_beside(prior.path / "parts", "parts", made_from)
    kept = read_beside(path, lambda packed: KeptParts(prior.names, keys, packed))
    if kept is not None or not make:
        return kept
    packed = _packed(prior, keys, first)
    keep_beside(path, packed)
    return KeptParts(prior.names, keys, packed)


def _packed(prior: Prior, keys: Sequence[str], first: int) -> Arrays:
    rows = {name: row for row, name in enumerate(prior.names)}
    found: dict[str, list[NDArray[Any]]] = {key: [np.empty(0)] * len(rows) for key in keys}
    for name, arrays in prior.parts(prior.names, keys):
        for key, array in arrays.items():
            some = array[:first] if key.startswith("surface") else array
            found[key][rows[name]] = some
    packed: Arrays = {}
    for key in keys:
        each = found.pop(key)
        packed[key] = np.concatenate([array.ravel() for array in each])
        packed[key + _SHAPES] = np.array([array.shape for array in each])
    return packed
