"""What is done to each object of a scene, here or by a helper: whoever is free."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Protocol, TypeVar

from brrp_cli.errors import PriorError
from brrp_cli.executors.helpers import Helpers, LostError, shared
from brrp_cli.methods.base import Method
from brrp_cli.methods.scene import Scene
from brrp_cli.prior.by_name import from_bytes, to_bytes
from brrp_cli.threads import cores

log = logging.getLogger(__name__)

# Each has the libraries in memory, 300 MB and more.
MOST = 3


class OfScene(Protocol):
    """What is done to each object hangs on this, and so on one scene."""

    @property
    def scene(self) -> Scene:
        """See above."""


C = TypeVar("C", bound=OfScene)
R = TypeVar("R")


def started_later(method: Method, workers: int | None, count: int | None) -> Helpers:
    """The helpers of a session, not started: `count`, or else one less than there are workers and
    `MOST` at most; none for a method that lets others do nothing."""
    if not method.takes_helpers:
        return Helpers(0)
    if count is None:
        count = min((workers or cores()) - 1, MOST)
    return Helpers(count, [__name__, "brrp_cli.methods.brrp_objects"])


@contextmanager
def shared_work(
    do: Callable[..., R], common: C, helpers: Helpers | None
) -> Iterator[Callable[..., R]]:
    """`do(common, *args)` as a function of args, which threads may call at the same time. Helpers
    import `do` by its name.

    A helper that is lost costs time: its work is done here.
    """
    # One device is for one process.
    if helpers is None or not helpers.any_ready or common.scene.device != "cpu":
        yield lambda *args: do(common, *args)
        return
    prior, known = common.scene.prior, _known(common)
    with ExitStack() as stack:
        try:
            path = str(stack.enter_context(shared(to_bytes(common, prior))))
        except OSError as error:  # no room for it
            log.info("Helpers are left out: %r", error)
            yield lambda *args: do(common, *args)
            return

        def call(*args: Any) -> R:
            with helpers.lent() as helper:
                if helper is None:
                    return do(common, *args)
                try:
                    answer: R = from_bytes(helper.call(_there, do, path, args), prior, known)
                except LostError:
                    return do(common, *args)
                return answer

        yield call


def _known(common: OfScene) -> tuple[object, ...]:
    """What results may hold of a scene, and are not to bring back."""
    scene = common.scene
    return scene.frame, scene.image.plane, scene.image.noise


_last: tuple[str, Any] | None = None


def _there(do: Callable[..., Any], path: str, args: tuple[Any, ...]) -> bytes:
    """In a helper, which does one thing at a time."""
    global _last
    if _last is None or _last[0] != path:
        try:
            _last = path, from_bytes(Path(path).read_bytes())
        except (OSError, PriorError) as error:
            # Who opened the prior before it was changed can still use it.
            raise LostError(repr(error)) from error
    common = _last[1]
    return to_bytes(do(common, *args), common.scene.prior, _known(common))
