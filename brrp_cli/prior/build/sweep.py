"""Files of a prior that nothing refers to any more."""

from __future__ import annotations

import logging
from pathlib import Path

from brrp_cli.prior.manifest import Manifest

log = logging.getLogger(__name__)


def sweep(out: Path, manifest: Manifest) -> None:
    """Delete files that nothing refers to, and what killed runs left half written."""
    appearance = out / manifest.appearance.file
    listed = {out / shard.file for shard in manifest.shards}
    listed |= {appearance, appearance.with_suffix(".npz")}
    for path in [
        *(out / "shards").glob("shard-*.h5"),
        *(out / "shards").glob(".shard-*.partial.h5"),
        *out.glob("appearance-*.np[yz]"),
        *out.glob(".appearance-*.partial.np[yz]"),
    ]:
        if path not in listed:
            _delete(path)
    for path in out.glob(".manifest.*.partial.*"):
        _delete(path)


def _delete(path: Path) -> None:
    """The prior is whole without it: what cannot be deleted is a line of `brrp verify`."""
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        log.warning("%s cannot be deleted: %s", path, error.strerror)
