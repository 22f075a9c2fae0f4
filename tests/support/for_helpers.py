"""What helper processes are asked to do in tests: they import it by its name."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass

from brrp_cli.errors import PriorError


def process() -> int:
    return os.getpid()


def threads() -> tuple[int, int]:
    """Of torch, and the most of any other library."""
    import torch

    from brrp_cli.dependencies import thread_pools

    return torch.get_num_threads(), max(each["num_threads"] for each in thread_pools().info())


def fail(how: str) -> None:
    if how == "bad prior":
        raise PriorError("It is damaged", where="shard", found=3)
    if how == "value":
        raise ValueError("no such value")
    raise _OpenError(lambda: how)


class _OpenError(Exception):
    """Holds what cannot be sent."""


def die() -> None:
    os._exit(3)


def sleep(seconds: float) -> None:
    time.sleep(seconds)


@dataclass(frozen=True)
class Common:
    """Of a scene; home : the process that shares the work."""

    scene: object
    home: int


def here_or_there(common: Common, way: str, number: int) -> tuple[bool, int, object]:
    """Whether this is a helper, a number, and the scene's frame; a helper may die of it."""
    helper = os.getpid() != common.home
    if helper and way == "die":
        die()
    if way == "fail":
        fail("bad prior")
    return helper, number, common.scene.frame
