"""posterior.h5 of any method, to be evaluated again later."""

from __future__ import annotations

from pathlib import Path

from brrp_cli.methods.registry import METHODS
from brrp_cli.reconstruction import StoredPosterior
from brrp_cli.results.posterior_file import read_posteriors


def open_posterior(path: str | Path) -> dict[int, StoredPosterior]:
    """Posteriors by object id: `open_posterior("out/posterior.h5")[3].probability(points)`.

    Errors: BrrpError when the file is missing, damaged, or of another schema or method.
    """
    classes = {each.kind: each for method in METHODS.values() for each in method.posteriors()}
    return read_posteriors(Path(path), classes)
