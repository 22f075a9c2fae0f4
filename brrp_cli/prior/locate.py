"""Which prior a command uses when nobody, or somebody, says."""

from __future__ import annotations

import os
from pathlib import Path

from brrp_cli.prior.manifest import FILE
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


def locate_prior(explicit: Path | None) -> tuple[Path, str]:
    """Folder of the prior to read, and where that name comes from.

    --prior, else BRRP_PRIOR, else the user's data folder, else the starter prior, which is built
    on first use. A prior that was named is taken whether it is there or not: opening it tells.
    """
    if explicit is not None:
        return explicit, "as given"
    if os.environ.get(ENVIRONMENT):
        return Path(os.environ[ENVIRONMENT]), ENVIRONMENT
    if (default_prior_path() / FILE).is_file():
        return default_prior_path(), "the user's data folder"
    from brrp_cli.demo.starter import starter_prior

    return starter_prior(), "the starter prior"
