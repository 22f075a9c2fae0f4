"""Values that hold objects of a prior, sent between processes: the objects go by their names.

Each process has opened the same prior and reads what it lacks. So a mesh of megabytes is not sent
with every result, and the same stored object stays the same object.
"""

from __future__ import annotations

import io
import pickle
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from brrp_cli.errors import PriorError
from brrp_cli.prior.objects import PriorObject
from brrp_cli.prior.shape import StoredShape
from brrp_cli.prior.store import Prior, open_prior

PRIOR, OBJECT, SHAPE, KNOWN = "prior", "object", "shape", "known"


def to_bytes(value: object, prior: Prior, known: Sequence[object] = ()) -> bytes:
    """`value`, with `prior` and its objects by name, and with objects that both sides know by their
    number among `known`."""
    stream = io.BytesIO()
    _Pickler(stream, prior, known).dump(value)
    return stream.getvalue()


def from_bytes(data: bytes, prior: Prior | None = None, known: Sequence[object] = ()) -> Any:
    """What `to_bytes` was given. Without `prior` the one that goes by its path is opened, once for
    a process. Errors: PriorError if it was built again meanwhile."""
    return _Unpickler(io.BytesIO(data), prior, known).load()


class _Pickler(pickle.Pickler):
    def __init__(self, stream: io.BytesIO, prior: Prior, known: Sequence[object]) -> None:
        super().__init__(stream, protocol=pickle.HIGHEST_PROTOCOL)
        self._prior = prior
        self._known = {id(each): number for number, each in enumerate(known)}
        self._shapes = {id(each.shape): each.name for each in prior.held}

    def persistent_id(self, value: object) -> tuple[str, Any] | None:
        if id(value) in self._known:
            return KNOWN, self._known[id(value)]
        if value is self._prior:
            return PRIOR, (self._prior.path.resolve(), self._prior.digest)
        if isinstance(value, PriorObject) and id(value.shape) in self._shapes:
            return OBJECT, value.name
        if isinstance(value, StoredShape) and id(value) in self._shapes:
            return SHAPE, self._shapes[id(value)]
        return None


class _Unpickler(pickle.Unpickler):
    def __init__(self, stream: io.BytesIO, prior: Prior | None, known: Sequence[object]) -> None:
        super().__init__(stream)
        self._prior, self._known = prior, known

    def persistent_load(self, key: tuple[str, Any]) -> Any:
        kind, what = key
        if kind == KNOWN:
            return self._known[what]
        if kind == PRIOR:
            self._prior = _opened(*what)
            return self._prior
        assert self._prior is not None
        stored = self._prior.load(what)
        return stored if kind == OBJECT else stored.shape


@lru_cache(maxsize=2)
def _opened(path: Path, digest: str) -> Prior:
    prior = open_prior(path)
    if prior.digest != digest:
        raise PriorError(
            "The prior was built again meanwhile", where=path, fix="open the prior again"
        )
    return prior
