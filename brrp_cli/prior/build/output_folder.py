"""Where a build may write: a prior, what an interrupted build left, or an empty folder."""

from __future__ import annotations

from fnmatch import fnmatch
from pathlib import Path

from brrp_cli.errors import OutputError
from brrp_cli.files import cannot_write
from brrp_cli.prior.manifest import FILE

# What a build leaves behind before its manifest is there.
_OURS = (".lock", "shards", "appearance-*", ".appearance-*", ".manifest.*")
_SHOWN = 5


def refuse_foreign(out: Path) -> None:
    """OutputError if the folder holds files that no build wrote, and no prior."""
    try:
        if not out.is_dir() or (out / FILE).exists():
            return
        names = sorted(path.name for path in out.iterdir())
    except OSError as error:
        raise cannot_write(out, error) from error
    strangers = [name for name in names if not any(fnmatch(name, ours) for ours in _OURS)]
    # A prior whose manifest is lost keeps its shards, and what was put beside them.
    if not strangers or any((out / "shards").glob("shard-*.h5")):
        return
    more = f" and {len(strangers) - _SHOWN} more" if len(strangers) > _SHOWN else ""
    raise OutputError(
        "The output folder holds other files, which a prior would mix with",
        where=out,
        expected="an empty or new folder, or a prior",
        found=", ".join(strangers[:_SHOWN]) + more,
        fix="name a folder of the prior's own with -o",
    )
