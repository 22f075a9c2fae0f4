"""Compiled loops are kept where there is a folder for it, and work where there is none."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

SOURCE = """
from brrp_cli.compiled import compiled

@compiled
def doubled(x):
    return 2 * x
"""
ASK = "import loops; print(loops.doubled(21), loops.doubled.stats.cache_path or 'nowhere')"


def asked(folder, **variables):
    """What `ASK` prints in a process of its own."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), *sys.path])}
    return subprocess.run(
        [sys.executable, "-B", "-c", ASK],
        env=environment | variables,
        check=True,
        capture_output=True,
        text=True,
    ).stdout.split()


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "loops.py").write_text(SOURCE)
    return tmp_path


def test_what_is_compiled_is_kept(folder):
    """The second process writes nothing more."""
    cache = folder / "cache"
    assert asked(folder, NUMBA_CACHE_DIR=str(cache))[0] == "42"
    kept = {path: path.stat().st_mtime_ns for path in cache.rglob("*.nb?")}
    assert kept
    assert asked(folder, NUMBA_CACHE_DIR=str(cache))[0] == "42"
    assert {path: path.stat().st_mtime_ns for path in cache.rglob("*.nb?")} == kept


def test_without_a_folder_to_keep_it_in_it_is_compiled_all_the_same(folder):
    """No folder can be made under a file: not the one that is named, not one beside the source, and
    not the user's."""
    (folder / "file").touch()
    # Where nothing can be written beside it.
    (folder / "__pycache__").touch()
    nowhere = str(folder / "file" / "cache")
    answer, kept = asked(folder, NUMBA_CACHE_DIR="", XDG_CACHE_HOME=nowhere, HOME=nowhere)
    assert (answer, kept) == ("42", "nowhere")
