import logging

import pytest

pytest_plugins = ["pointsdf_fixtures", "starter_fixtures", "table_fixtures"]


@pytest.fixture(scope="session", autouse=True)
def no_clip_of_the_users(tmp_path_factory: pytest.TempPathFactory):
    """`auto` means no CLIP on any machine, whatever was fetched or named there."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        patch.delenv("BRRP_CLIP_DIR", raising=False)
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
