"""Processes beside this one that share the work of a session, once they are ready.

Threads of one process take turns in the interpreter, so that small steps of NumPy gain little from
a second core. Helpers start in the background; whoever needs one before it is ready does the work
himself. What goes wrong with a helper, be it that it dies or hangs, costs time and nothing else.

They are not workers of `multiprocessing` or of a pool, which run the main module of the user's
script once more: a script that opens a camera would open it again.
"""

from __future__ import annotations

import logging
import os
import pickle
import subprocess
import sys
import tempfile
import threading
import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

from brrp_cli.executors.helper_process import BEGIN
from brrp_cli.executors.processes import ONE_THREAD

log = logging.getLogger(__name__)

# Seconds that one task may take before its helper is given up.
PATIENCE = 120.0
# Helpers that are started at most in place of such as were lost.
MOST_LOST = 3


class LostError(Exception):
    """A helper died, hung, or cannot do it: the work is still to be done."""


class Helpers:
    """So many processes on this machine; `modules` are imported before they are ready. They end
    with this object, and with the process that it is in."""

    def __init__(self, count: int, modules: Sequence[str] = ()) -> None:
        self.count = count
        self._modules = tuple(modules)
        self._helpers: list[Helper] = []
        self._lending = threading.Lock()
        self._lost = 0
        self._end = weakref.finalize(self, _close, self._helpers)

    def start(self) -> None:
        """Start those that are not there, in the background."""
        with self._lending:
            self._let_lost_go()
            # Not once closed, and not for ever where every one is lost.
            while self._end.alive and len(self._helpers) < self.count and self._lost <= MOST_LOST:
                self._helpers.append(Helper(self._modules))

    def wait(self) -> None:
        """Until all that were started are ready, or lost."""
        for helper in list(self._helpers):
            helper.is_ready(PATIENCE)

    def close(self) -> None:
        """End them; they do not start again."""
        self._end()

    @property
    def any_ready(self) -> bool:
        """Whether one has started."""
        # Of two threads that ask one helper, one would take its word, and the other wait for it.
        with self._lending:
            return any(helper.is_ready() for helper in self._helpers)

    @property
    def processes(self) -> list[int]:
        """Their numbers, of those that started."""
        return [helper.process for helper in list(self._helpers) if helper.process is not None]

    @contextmanager
    def lent(self) -> Iterator[Helper | None]:
        """One that is ready and has nothing to do; None where there is none."""
        with self._lending:
            free = (each for each in self._helpers if not each.busy and each.is_ready())
            helper = next(free, None)
            if helper is not None:
                helper.busy = True
        try:
            yield helper
        finally:
            with self._lending:
                if helper is not None:
                    helper.busy = False
                self._let_lost_go()

    def _let_lost_go(self) -> None:
        """Under the lock. One that another thread has in hand goes once that gives it back."""
        for each in [each for each in self._helpers if each.is_lost and not each.busy]:
            self._lost += 1
            self._helpers.remove(each)
            each.close()


class Helper:
    """One process. busy : whether it is lent; is_lost : whether it is of no use any more"""

    def __init__(self, modules: tuple[str, ...]) -> None:
        self.busy = False
        self.is_lost = False
        self._ready = False
        self._pipe, theirs = Pipe()
        path = os.pathsep.join(each or str(Path.cwd()) for each in sys.path)
        environment = {**os.environ, **dict.fromkeys(ONE_THREAD, "1"), "PYTHONPATH": path}
        self._process: subprocess.Popen[bytes] | None = None
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-c", BEGIN, str(theirs.fileno()), *modules],
                pass_fds=[theirs.fileno()],
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
            )
        except OSError as error:  # no memory, or no process left
            self._lose(error)
        theirs.close()

    @property
    def process(self) -> int | None:
        """Its number; None where it did not start."""
        return None if self._process is None else self._process.pid

    def is_ready(self, patience: float = 0.0) -> bool:
        """Whether it has started; waits for that so many seconds at most."""
        if not self._ready and not self.is_lost:
            try:
                self._ready = self._pipe.poll(patience) and self._pipe.recv() is None
            except (OSError, EOFError) as error:
                self._lose(error)
        return self._ready and not self.is_lost

    def call(self, function: Callable[..., Any], *args: Any) -> Any:
        """function(*args), done there; a function is sent by its name. Errors: LostError; else the
        function's own."""
        task = pickle.dumps((function, args), protocol=pickle.HIGHEST_PROTOCOL)
        try:
            self._pipe.send_bytes(task)
            if not self._pipe.poll(PATIENCE):
                raise TimeoutError(f"no answer in {PATIENCE:g} s")
            answer = self._pipe.recv_bytes()
        except (OSError, EOFError) as error:
            self._lose(error)
            raise LostError from error
        good, value = pickle.loads(answer)
        if not good:
            raise value
        return value

    def close(self) -> None:
        """End it at once."""
        self._pipe.close()
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def _lose(self, why: Exception) -> None:
        log.info("A helper process was lost: %r", why)
        self.is_lost = True


@contextmanager
def shared(payload: bytes) -> Iterator[Path]:
    """A file of what many tasks need, for as long as they run."""
    with tempfile.NamedTemporaryFile(prefix="brrp_", suffix=".shared") as file:
        file.write(payload)
        file.flush()
        yield Path(file.name)


def _close(helpers: list[Helper]) -> None:
    for helper in helpers:
        helper.close()
    helpers.clear()
