"""A PyBullet world of its own for each scene, so that none depends on what ran before it."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from brrp_cli.dependencies import import_library


class World:
    """PyBullet's functions, bound to one physics server, and its constants."""

    def __init__(self, pybullet: Any, client: int) -> None:
        self._pybullet = pybullet
        self._client = client

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._pybullet, name)
        return functools.partial(value, physicsClientId=self._client) if callable(value) else value


@contextmanager
def new_world() -> Iterator[World]:
    """An empty world without a window, closed at the end."""
    pybullet = import_library("pybullet")
    client = pybullet.connect(pybullet.DIRECT)
    try:
        yield World(pybullet, client)
    finally:
        pybullet.disconnect(client)
