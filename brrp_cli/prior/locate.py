"""Where priors lie when nobody says."""

from __future__ import annotations

import os
from pathlib import Path

from brrp_cli.version import __version__

ENVIRONMENT = "BRRP_PRIOR"


def data_folder() -> Path:
    """The user's folder for brrp's data."""
    import platformdirs

    return Path(platformdirs.user_data_dir("brrp"))


def default_prior_path() -> Path:
    """Where `build-prior` writes when neither -o nor BRRP_PRIOR says otherwise."""
    return data_folder() / "prior"


def starter_prior_path() -> Path:
    """Where the starter prior of this version lies once it has been built."""
    return data_folder() / f"starter-{__version__}"


def output_prior(explicit: Path | None) -> tuple[Path, str]:
    """Folder for `build-prior` to write, and where that name comes from."""
    if explicit is not None:
        return explicit, "-o"
    if os.environ.get(ENVIRONMENT):
        return Path(os.environ[ENVIRONMENT]), ENVIRONMENT
    return default_prior_path(), "the user's data folder"
