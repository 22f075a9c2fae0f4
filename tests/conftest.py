import logging
import multiprocessing
import os
from multiprocessing.forkserver import ensure_running
from pathlib import Path

import pytest
from h5py._objects import phil

from brrp_cli.executors import processes

# Dask's workers too, see `workers_are_forked`; read when Dask is imported.
os.environ["DASK_DISTRIBUTED__WORKER__MULTIPROCESSING_METHOD"] = "forkserver"

pytest_plugins = ["box_and_can", "pointsdf_fixtures", "starter_fixtures", "table_fixtures"]


@pytest.fixture(scope="session", autouse=True)
def no_clip_of_the_users(tmp_path_factory: pytest.TempPathFactory):
    """`auto` means no CLIP on any machine, whatever was fetched or named there."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        patch.delenv("BRRP_CLIP_DIR", raising=False)
        yield


@pytest.fixture(scope="session", autouse=True)
def workers_are_forked(no_clip_of_the_users):
    """Worker processes come from one that has loaded the libraries: to load them takes a process of
    its own three seconds. Tests of the processes themselves, and commands that are run in a process
    of their own, start them as users do."""
    # What makes an object of a prior, and what measures one.
    modules = ["loaded_libraries", "torch", "distributed", "brrp_cli.api"]
    modules += ["brrp_cli.evaluation.run", "brrp_cli.prior.build.build"]
    multiprocessing.set_forkserver_preload(modules)
    with pytest.MonkeyPatch.context() as patch:
        # Where the package is installed, it is loaded from there and not from this folder.
        patch.setenv("PYTHONSAFEPATH", "1")
        patch.setenv("PYTHONPATH", str(Path(__file__).with_name("support")), os.pathsep)
        # OpenMP's threads do not survive a fork: what waits for one then waits for ever.
        for name in processes.ONE_THREAD:
            patch.setenv(name, "1")
        ensure_running()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(processes, "START", "forkserver")
        yield


LEVELS = [(logger, logger.level) for logger in (logging.getLogger(), logging.getLogger("brrp_cli"))]


@pytest.fixture(autouse=True)
def log_level_is_restored():
    """A command that is run in this process, by a fixture too, sets the level for good, as with
    `--quiet`."""
    for logger, level in LEVELS:
        logger.setLevel(level)
    yield
    for logger, level in LEVELS:
        logger.setLevel(level)


@pytest.fixture(autouse=True)
def h5py_is_not_locked():
    """What a test leaves behind does not hold h5py's lock. Another thread that waits for it, as one
    of a pool of processes may when it collects garbage, waits for ever."""
    yield
    assert not phil._is_owned()
