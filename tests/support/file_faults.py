"""Every step that a process takes to change files below a folder, counted; at one of them it is
killed, or the step fails.

Steps are the writes of at most `CHUNK` bytes, creations, fsyncs, renames, deletions and new folders
that go through Python, which is all that the builder does.
"""

from __future__ import annotations

import builtins
import errno
import io
import os
import signal
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

CHUNK = 4096
WRITE, CREATE, FSYNC, RENAME, DELETE, FOLDER = (
    "write",
    "create",
    "fsync",
    "rename",
    "delete",
    "folder",
)


@dataclass
class Steps:
    """What was done below `folder`: (kind, path). `before` is called with the number of each step
    and its kind, and may not return, or raise."""

    folder: Path
    before: Callable[[int, str], None] = lambda number, kind: None
    chunk: int = CHUNK
    done: list[tuple[str, str]] = field(default_factory=list)

    def take(self, kind: str, path: object) -> None:
        """Note a step, unless it is elsewhere."""
        text = os.fsdecode(path) if isinstance(path, bytes | str | os.PathLike) else str(path)
        if text.startswith(str(self.folder)):
            self.done.append((kind, text))
            self.before(len(self.done) - 1, kind)

    def count(self, *kinds: str) -> int:
        """How many steps of these kinds."""
        return sum(kind in kinds for kind, _ in self.done)


def kill_at(number: int) -> Callable[[int, str], None]:
    """The process is gone, without another word, in place of that step."""

    def before(at: int, kind: str) -> None:
        if at == number:
            os.kill(os.getpid(), signal.SIGKILL)

    return before


def fail_at(number: int, code: int = errno.ENOSPC) -> Callable[[int, str], None]:
    """That step fails."""

    def before(at: int, kind: str) -> None:
        if at == number:
            raise OSError(code, os.strerror(code))

    return before


@contextmanager
def watched(steps: Steps) -> Iterator[Steps]:
    """Every step of this process below the folder goes by `steps`."""

    class Raw(io.FileIO):
        def write(self, data) -> int:  # type: ignore[no-untyped-def]
            data = memoryview(data).cast("B")[: steps.chunk]
            steps.take(WRITE, self.name)
            return super().write(data)

    real = {name: getattr(os, name) for name in ("open", "fsync", "rename", "replace", "unlink")}
    real_mkdir, real_open = os.mkdir, io.open

    def opened(file, mode="r", *args, **options):  # type: ignore[no-untyped-def]
        plain = "b" in mode and set(mode) & set("wax+") and isinstance(file, str | os.PathLike)
        if not plain or not str(file).startswith(str(steps.folder)):
            return real_open(file, mode, *args, **options)
        if not Path(file).exists():
            steps.take(CREATE, file)
        raw = Raw(str(file), mode.replace("b", ""))
        return (io.BufferedRandom if "+" in mode else io.BufferedWriter)(raw, steps.chunk)

    def os_open(path, flags, *args, **options):  # type: ignore[no-untyped-def]
        if flags & os.O_CREAT and not Path(path).exists():
            steps.take(CREATE, path)
        return real["open"](path, flags, *args, **options)

    def fsync(descriptor: int) -> None:
        steps.take(FSYNC, Path(f"/proc/self/fd/{descriptor}").readlink())
        real["fsync"](descriptor)

    def rename(source, target) -> None:  # type: ignore[no-untyped-def]
        steps.take(RENAME, target)
        real["rename"](source, target)

    def unlink(path, **options) -> None:  # type: ignore[no-untyped-def]
        if Path(path).exists():
            steps.take(DELETE, path)
        real["unlink"](path, **options)

    def mkdir(path, *args, **options) -> None:  # type: ignore[no-untyped-def]
        if not Path(path).exists():
            steps.take(FOLDER, path)
        real_mkdir(path, *args, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(io, "open", opened)
        patch.setattr(builtins, "open", opened)
        patch.setattr(os, "open", os_open)
        patch.setattr(os, "fsync", fsync)
        patch.setattr(os, "rename", rename)
        patch.setattr(os, "replace", rename)
        patch.setattr(os, "unlink", unlink)
        patch.setattr(os, "mkdir", mkdir)
        yield steps


def in_a_process(work: Callable[[], None]) -> int:
    """Run `work` in a fork of this process; what became of it: 0, or minus the signal."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            work()
            code = 0
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
