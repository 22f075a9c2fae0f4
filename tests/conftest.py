import logging

import pytest

pytest_plugins = ["pointsdf_fixtures", "table_fixtures"]


@pytest.fixture(scope="session", autouse=True)
def no_clip_of_the_users(tmp_path_factory: pytest.TempPathFactory):
    """`auto` means no CLIP on any machine, whatever was fetched or named there."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        patch.delenv("BRRP_CLIP_DIR", raising=False)
        yield


@pytest.fixture(autouse=True)
def log_level_is_restored():
    """A command that is run in this process sets the level, as with `--quiet`, for good."""
    loggers = [logging.getLogger(), logging.getLogger("brrp_cli")]
    levels = [logger.level for logger in loggers]
    yield
    for logger, level in zip(loggers, levels, strict=True):
        logger.setLevel(level)
