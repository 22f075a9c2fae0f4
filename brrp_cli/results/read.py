"""A folder of results, read back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SurfaceConfig
from brrp_cli.config.tables import changed
from brrp_cli.errors import ConfigError, ResultError
from brrp_cli.files import parse_json, trouble_of
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.npz import load_frame
from brrp_cli.notebook import picture_html, result_html
from brrp_cli.observation.support_plane import Plane
from brrp_cli.reconstruction import StoredPosterior, Surface
from brrp_cli.results.write import FRAME, POSTERIOR, PREVIEW, RECORD, SCHEMA, mesh_name
from brrp_cli.spoken import counted, kind_of

if TYPE_CHECKING:
    import trimesh

INSIDE_DEMO = "result"
# Part of an object's points that the newest frame of a session shows of it at least.
_KEPT = 0.8
PREVIEW_WIDTH = 1200  # pixels in a notebook
AGAIN = "run `brrp reconstruct` again"

# From the path of posterior.h5 to posteriors by object id.
OpenPosterior = Callable[[Path], dict[int, StoredPosterior]]


@dataclass(frozen=True, repr=False)
class StoredResult:
    """What `write_results` wrote.

    record : the content of result.json; open_posterior : reads the methods' posteriors

    Meshes, points and the plane are given in the frame of the meshes (`record["frame"]`), metres;
    the posteriors and `frame` know the camera frame only.
    """

    folder: Path
    record: dict[str, Any]
    open_posterior: OpenPosterior

    def __repr__(self) -> str:
        """Where it lies and how many objects it has, without the record."""
        made = sum(item["mesh"] is not None for item in self.record["objects"])
        return (
            f"StoredResult({self.folder}: {made} of {counted(len(self.object_ids), 'object')},"
            f" {self.record['method']})"
        )

    def _repr_html_(self) -> str:
        """For notebooks: preview.png."""
        path = self.folder / PREVIEW
        picture = picture_html(path.read_bytes(), PREVIEW_WIDTH) if path.is_file() else ""
        return result_html(repr(self), picture)

    @cached_property
    def T_frame_cam(self) -> NDArray[np.float64]:
        """(4, 4), from the camera frame to the frame of the meshes."""
        return np.asarray(self.record["T_frame_cam"], dtype=np.float64)

    @property
    def object_ids(self) -> list[int]:
        """Ids of all objects of the frame, with a mesh or without."""
        return [item["id"] for item in self.record["objects"]]

    @cached_property
    def surfaces(self) -> dict[int, Surface]:
        """Meshes by object id, in the frame of the meshes. Errors: ResultError."""
        return {
            item["id"]: self._surface(item["mesh"], item["uncertainty_unit"])
            for item in self.record["objects"]
            if item["mesh"] is not None
        }

    @cached_property
    def frame(self) -> Frame:
        """The frame that was reconstructed. Errors: FrameError; ResultError if its masks were
        corrected since."""
        frame = load_frame(self.folder / FRAME)
        _check_masks(frame, self.record, self.folder)
        return frame

    @cached_property
    def posteriors(self) -> dict[int, StoredPosterior]:
        """Posteriors by object id. Errors: BrrpError."""
        return self.open_posterior(self.folder / POSTERIOR)

    @property
    def plane_cam(self) -> Plane | None:
        """The support plane in the camera frame."""
        stored = self.record["plane_cam"]
        return None if stored is None else Plane(np.asarray(stored["normal"]), stored["offset"])

    @property
    def plane(self) -> Plane | None:
        """The support plane in the frame of the meshes."""
        plane = self.plane_cam
        if plane is None:
            return None
        return plane.moved(self.T_frame_cam)

    @property
    def surface_config(self) -> SurfaceConfig:
        """How the meshes were made."""
        return _surface_config(self.record)

    def _surface(self, name: str, unit: str) -> Surface:
        mesh = _read_mesh(self.folder / name)
        values = mesh.metadata["_ply_raw"]["vertex"]["data"]["uncertainty"]
        return Surface(
            np.asarray(mesh.vertices, dtype=np.float64),
            np.asarray(mesh.faces, dtype=np.int64),
            np.asarray(values, dtype=np.float32).reshape(-1),
            unit,
            _colours(mesh),
        )


def open_result(folder: str | Path, open_posterior: OpenPosterior) -> StoredResult:
    """The results in a folder that `brrp reconstruct` wrote, or in one of `brrp demo`.

    open_posterior : called when the posteriors are asked for

    Errors: ResultError if there are none, or if they are of another schema.
    """
    folder = Path(folder)
    if not (folder / RECORD).is_file() and (folder / INSIDE_DEMO / RECORD).is_file():
        folder = folder / INSIDE_DEMO
    path = folder / RECORD
    try:
        record = parse_json(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ResultError(
            "There are no results that can be read",
            where=folder,
            expected=f"a folder that `brrp reconstruct` wrote, with {RECORD} in it",
            found=trouble_of(error),
            fix="give the folder that `brrp reconstruct` named in its last line",
        ) from error
    if not isinstance(record, dict) or record.get("schema") != SCHEMA:
        found = record.get("schema") if isinstance(record, dict) else kind_of(record)
        raise ResultError(
            "The results have another schema", where=path, expected=SCHEMA, found=found, fix=AGAIN
        )
    if not (folder / FRAME).is_file():
        raise ResultError(
            "The results lack the frame that they are of", where=folder, expected=FRAME, fix=AGAIN
        )
    try:
        _check(record)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise ResultError(
            "The record of the results is damaged",
            where=path,
            expected="what `brrp reconstruct` wrote",
            found=trouble_of(error),
            fix=AGAIN,
        ) from error
    return StoredResult(folder, record, open_posterior)


def _check(record: dict[str, Any]) -> None:
    """Whether everything that is read of a record is there.

    Errors: AttributeError, KeyError, TypeError, ValueError.
    """
    T = _numbers(record["T_frame_cam"], (4, 4))
    if not np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-3):
        raise ValueError("T_frame_cam is no rigid transform")
    if record["frame"] not in ("camera", "world"):
        raise ValueError(f"frame {record['frame']!r}")
    for key in ("method", "brrp"):
        _text(record[key])
    for key in ("retriever", "seed"):
        record[key]
    plane = record["plane_cam"]
    if plane is not None:
        if abs(np.linalg.norm(_numbers(plane["normal"], (3,))) - 1) > 1e-3:
            raise ValueError("the plane's normal is no unit vector")
        _numbers(plane["offset"], ())
    if not 0 < _surface_config(record).level < 1:
        raise ValueError("no surface has that level")
    ids = [item["id"] for item in record["objects"]]
    if not all(type(i) is int for i in ids) or len(set(ids)) < len(ids):
        raise ValueError(f"ids {ids[:10]}")
    for item in record["objects"]:
        _text(item["status"])
        _text(item["message"])
        _numbers(item["points"], ())
        if item["mesh"] is not None:
            # A name of another's making could lead out of the folder.
            if item["mesh"] != mesh_name(item["id"]):
                raise ValueError(f"mesh {item['mesh']!r}")
            _text(item["uncertainty_unit"])


def _check_masks(frame: Frame, record: dict[str, Any], folder: Path) -> None:
    """ResultError where objects of the results lost their masks, or points of them to another."""
    ids, counts = np.unique(frame.segmap[frame.valid], return_counts=True)
    points = dict(zip(ids.tolist(), counts.tolist(), strict=True))
    # A session keeps what it made of an earlier frame of an object at rest, where other pixels had
    # no return.
    others = set(frame.object_ids) - {item["id"] for item in record["objects"]}
    least = 1.0 if others else _KEPT
    lost = [i["id"] for i in record["objects"] if points.get(i["id"], 0) < least * i["points"]]
    if lost:
        raise ResultError(
            "The results are of other masks than those of the frame beside them",
            where=folder / FRAME,
            expected="the masks that were reconstructed",
            found=f"other masks of the objects {', '.join(map(str, lost))}",
            fix=f"reconstruct the corrected frame: brrp reconstruct {quote(str(folder / FRAME))}"
            " -o NEW/",
        )


def _surface_config(record: dict[str, Any]) -> SurfaceConfig:
    """Errors: KeyError, TypeError, ValueError."""
    table = record["config"]["surface"]
    if not isinstance(table, dict):
        raise TypeError(f"surface {table!r:.60}")
    try:
        return changed(SurfaceConfig(), table, RECORD, "config.surface.")
    except ConfigError as error:
        raise ValueError(f"{error.where} is {error.found}") from error


def _numbers(value: Any, shape: tuple[int, ...]) -> NDArray[np.float64]:
    array = np.asarray(value, dtype=np.float64)
    if array.shape != shape or not np.isfinite(array).all():
        raise ValueError(f"{value!r:.60} is not {shape} finite numbers")
    return array


def _text(value: Any) -> None:
    if not isinstance(value, str):
        raise TypeError(f"{value!r:.60} is no text")


def _colours(mesh: trimesh.Trimesh) -> NDArray[np.uint8]:
    """RGB (n, 3) of a mesh's vertices; grey where the file has none."""
    from trimesh.visual import ColorVisuals

    visual = mesh.visual
    if not isinstance(visual, ColorVisuals):
        return np.full((len(mesh.vertices), 3), 128, np.uint8)
    return np.asarray(visual.vertex_colors, dtype=np.uint8)[:, :3]


def _read_mesh(path: Path) -> trimesh.Trimesh:
    import trimesh

    try:
        mesh = trimesh.load_mesh(path, process=False)
        mesh.metadata["_ply_raw"]["vertex"]["data"]["uncertainty"]
    except (OSError, KeyError, ValueError, IndexError) as error:
        raise ResultError(
            "A mesh of the results cannot be read",
            where=path,
            expected="a PLY with the scalar `uncertainty` on its vertices, as brrp writes it",
            found=trouble_of(error),
            fix=AGAIN,
        ) from error
    return mesh
