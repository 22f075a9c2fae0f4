"""posterior.h5: the posterior of every object of a frame, to be evaluated again later.

    /               schema (int), frame ("camera"), units ("metre")
    /objects/ID     kind: which class wrote the group; the rest is that class's own, which its
                    `write` describes
    /shared/NAME    what several objects have in common, such as the map of a whole frame

Points are in the camera frame, metres, whatever frame the meshes were written in.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from brrp_cli.errors import BrrpError
from brrp_cli.files import trouble_of
from brrp_cli.hdf5 import SharedParts, hdf5_bytes, members
from brrp_cli.reconstruction import StoredPosterior

if TYPE_CHECKING:
    import h5py

SCHEMA = 3


def save_posteriors(posteriors: Mapping[int, StoredPosterior], path: Path) -> None:
    """Write the posteriors of a frame's objects; the same posteriors give the same bytes."""

    def fill(file: h5py.File) -> None:
        file.attrs.update({"schema": SCHEMA, "frame": "camera", "units": "metre"})
        objects = file.create_group("objects")
        shared = SharedParts(file.create_group("shared"))
        for object_id, posterior in posteriors.items():
            group = objects.create_group(str(object_id))
            group.attrs["kind"] = posterior.kind
            posterior.write(group, shared)

    path.write_bytes(hdf5_bytes(fill))


def read_posteriors(
    path: Path, classes: Mapping[str, type[StoredPosterior]]
) -> dict[int, StoredPosterior]:
    """Posteriors by object id. classes : by their `kind`.

    Errors: BrrpError when the file is missing, damaged, of another schema or of no such class.
    """
    import h5py

    try:
        with h5py.File(path, "r") as file:
            found = file.attrs.get("schema")
            if found != SCHEMA:
                raise BrrpError(
                    "The posterior file has another schema",
                    where=path,
                    expected=SCHEMA,
                    found=found,
                    fix="read it with the version of brrp that wrote it",
                )
            shared = SharedParts(file["shared"])
            return {
                int(name): _class_of(path, group, classes).read(group, shared)
                for name, group in members(file["objects"])
            }
    except (OSError, KeyError, ValueError) as error:
        raise BrrpError(
            "The posterior file cannot be read",
            where=path,
            found=trouble_of(error),
            fix="run `brrp reconstruct` again",
        ) from error


def _class_of(
    path: Path, group: h5py.Group, classes: Mapping[str, type[StoredPosterior]]
) -> type[StoredPosterior]:
    kind = str(group.attrs["kind"])
    if kind not in classes:
        raise BrrpError(
            "The posterior is of a method that is not here",
            where=f"{path}: {group.name}",
            expected=", ".join(classes),
            found=kind,
            fix="read it where the method that wrote it is registered",
        )
    return classes[kind]
