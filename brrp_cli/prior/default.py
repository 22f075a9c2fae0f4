"""Which prior a command reads when nobody, or somebody, says."""

from __future__ import annotations

import os
from pathlib import Path

from brrp_cli.prior.locate import ENVIRONMENT, default_prior_path
from brrp_cli.prior.manifest import FILE


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
    # Builds, and so imports, more than the path of a prior that is there.
    from brrp_cli.prior.build.starter import starter_prior

    return starter_prior(), "the starter prior"
