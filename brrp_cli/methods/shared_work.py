"""What is done to each object of a scene, here or by a helper: whoever is free."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TypeVar

from brrp_cli.errors import PriorError
from brrp_cli.executors.helpers import Helpers, LostError, shared
from brrp_cli.methods.base import Method
from brrp_cli.methods.scene import SeenScene
from brrp_cli.prior.by_name import from_bytes, to_bytes
from brrp_cli.retrieval.base import Each
from brrp_cli.threads import cores, in_threads

log = logging.getLogger(__name__)

# Each has the libraries in memory, 300 MB and more.
MOST = 3


R = TypeVar("R")


def started_later(method: Method, workers: int | None, count: int | None) -> Helpers:
    """The helpers of a session, not started: `count`, or else one less than there are workers and
    `MOST` at most; none for a method that lets others do nothing."""
    if not method.takes_helpers:
        return Helpers(0)
    if count is None:
        count = min((workers or cores()) - 1, MOST)
    return Helpers(count, [__name__, "brrp_cli.methods.brrp_objects", "brrp_cli.retrieval.steps"])


@contextmanager
def shared_work(
    do: Callable[..., R], common: Any, scene: SeenScene, helpers: Helpers | None
) -> Iterator[Callable[..., R]]:
    """`do(common, *args)` as a function of args, which threads may call at the same time. Helpers
    import `do` by its name.

    scene : to which `common` belongs. A helper that is lost costs time: its work is done here.
    """
    # One device is for one process.
    if helpers is None or not helpers.any_ready or scene.device != "cpu":
        yield lambda *args: do(common, *args)
        return
    prior, known = scene.prior, _known(scene)
    with ExitStack() as stack:
        try:
            path = str(stack.enter_context(shared(to_bytes((common, scene), prior))))
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


def each_shared(scene: SeenScene, helpers: Helpers | None, workers: int) -> Each:
    """`Each` of retrievers, over `workers` threads and the helpers."""

    def each(do: Callable[..., R], common: Any, args: Sequence[tuple[Any, ...]], /) -> list[R]:
        with shared_work(do, common, scene, helpers) as work:
            return list(in_threads(lambda one: work(*one), args, workers))

    return each


def _known(scene: SeenScene) -> tuple[object, ...]:
    """What results may hold of a scene, and are not to bring back."""
    return scene.frame, scene.image.plane, scene.image.noise


_last: tuple[str, Any, SeenScene] | None = None


def _there(do: Callable[..., Any], path: str, args: tuple[Any, ...]) -> bytes:
    """In a helper, which does one thing at a time."""
    global _last
    if _last is None or _last[0] != path:
        try:
            _last = path, *from_bytes(Path(path).read_bytes())
        except (OSError, PriorError) as error:
            # Who opened the prior before it was changed can still use it.
            raise LostError(repr(error)) from error
    _, common, scene = _last
    return to_bytes(do(common, *args), scene.prior, _known(scene))
