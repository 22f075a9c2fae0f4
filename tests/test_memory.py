"""Threads of the command share one heap; those of other programs have one each."""

from __future__ import annotations

import ctypes
import subprocess
import sys

import pytest

# Four threads that live at the same time, each with something on its heap; then how many there are.
HEAPS = """
import ctypes, threading
{before}
libc = ctypes.CDLL(None)
libc.malloc.restype = libc.fopen.restype = ctypes.c_void_p
together = threading.Barrier(4)
def hold():
    libc.free(ctypes.c_void_p(libc.malloc(1000)))
    together.wait()
threads = [threading.Thread(target=hold) for _ in range(4)]
[each.start() for each in threads]
[each.join() for each in threads]
file = libc.fopen(b"/dev/stdout", b"w")
libc.malloc_info(0, ctypes.c_void_p(file))
libc.fclose(ctypes.c_void_p(file))
"""
ONE = "from brrp_cli.memory import one_heap; one_heap()"
COMMAND = (
    "from click.testing import CliRunner; from brrp_cli.cli import main;"
    "assert CliRunner().invoke(main, ['demo', '--seed', 'x']).exit_code == 2"
)


def heaps(before: str) -> int:
    done = subprocess.run(
        [sys.executable, "-c", HEAPS.format(before=before)], capture_output=True, check=True
    )
    return done.stdout.count(b"<heap nr=")


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "malloc_info"), reason="no glibc")
def test_threads_share_one_heap():
    assert heaps("") > 1
    assert heaps(ONE) == 1
    assert heaps(COMMAND) == 1
