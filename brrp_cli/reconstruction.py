"""What every method gives back: for each object, occupancy probability at points."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from brrp_cli.frames.frame import Frame
from brrp_cli.observation.support_plane import Plane
from brrp_cli.spoken import counted

if TYPE_CHECKING:
    import h5py
    import trimesh

    from brrp_cli.hdf5 import SharedParts

Axes = tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]

OK = "ok"
TOO_FEW_POINTS = "too_few_points"
NO_SURFACE = "no_surface"
FAILED = "failed"

# Units of uncertainty on a surface: standard deviation of its place, or variance of the logit.
METRES = "metre"
LOGIT_VARIANCE = "logit^2"


ROW = ("id", "taken for", "weight", "size", "± mm", "status")
LINES = 10  # of a result that is printed


class OccupancyPosterior(Protocol):
    """A distribution over one object's shape, in the camera frame.

    `bounds` is the box outside of which the method says nothing and occupancy counts as 0.
    """

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) metres, camera frame: lower and upper corner."""

    def probability(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Occupancy probability (n,) at points (n, 3), metres, camera frame. Errors: BrrpError for
        what are no points."""

    def probability_volume(self, axes: Axes) -> NDArray[np.float32]:
        """Occupancy probability (nx, ny, nz) on a grid of camera-frame coordinates, metres."""

    @property
    def surface_unit(self) -> str:
        """Unit of `surface_uncertainty`: METRES or LOGIT_VARIANCE."""

    def uncertainty(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """How unsure (n,), >= 0, in the method's own unit: what ranks errors of occupancy."""

    def surface_uncertainty(self, vertices: NDArray[np.floating]) -> NDArray[np.float32]:
        """How unsure (n,), >= 0, the surface is at its own vertices (n, 3), where occupancy is 0.5
        everywhere; in `surface_unit`."""


class StoredPosterior(OccupancyPosterior, Protocol):
    """A posterior that can be kept in a file; every method's is one.

    kind : what the file calls the class, so that reading finds it
    """

    kind: ClassVar[str]

    def write(self, group: h5py.Group, shared: SharedParts) -> None:
        """Write this object into its own group; the same posterior gives the same bytes.

        shared : for what all objects of the frame have in common
        """

    @classmethod
    def read(cls, group: h5py.Group, shared: SharedParts) -> StoredPosterior:
        """What `write` wrote. Errors: KeyError, ValueError where something is missing or does not
        fit the rest."""


@runtime_checkable
class MovablePosterior(StoredPosterior, Protocol):
    """A posterior that can be given in another frame."""

    def moved(self, T_target_cam: NDArray[np.float64]) -> StoredPosterior:
        """The same in the frame that T_target_cam (4, 4), rigid, leads to."""


@dataclass(frozen=True, repr=False)
class Surface:
    """A closed, outward triangle mesh.

    vertices : (n, 3) float64, metres, camera frame; faces : (m, 3) int64; uncertainty : (n,)
    float32, the posterior's uncertainty at each vertex, in `uncertainty_unit`.
    colours : (n, 3) uint8, RGB at the vertices; None where nobody has coloured them yet
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    uncertainty: NDArray[np.float32]
    uncertainty_unit: str
    colours: NDArray[np.uint8] | None = None

    def __repr__(self) -> str:
        """Sizes, without the arrays."""
        return f"Surface({len(self.vertices)} vertices, {len(self.faces)} faces)"

    def as_trimesh(self) -> trimesh.Trimesh:
        """The same as a trimesh, vertices in the same order."""
        import trimesh

        return trimesh.Trimesh(self.vertices, self.faces, process=False)


@dataclass(repr=False)
class Retrieved:
    """One stored object that was retrieved for one seen object.

    T_cam_object maps the stored object's normalised coordinates to the camera frame (a
    similarity); T_cam_mesh : (4, 4) rigid, metres, from the object's own mesh file, multiplied by
    size_factor, to the camera frame: x_cam = T_cam_mesh (size_factor * x_mesh). All three are None
    where registration found no inlier.
    inliers, fitness : of the paper's registration: pairs, and their share of the stored cloud
    alignment_score : what the frame says for the best placement, 1 at best; weight : of the object
    in the posterior; both None where placements are not verified.
    alike : T_cam_mesh (4, 4) of other placements, turned about itself, that the frame does not tell
    apart from that one
    """

    name: str
    probability: float
    T_cam_object: NDArray[np.float64] | None = None
    T_cam_mesh: NDArray[np.float64] | None = None
    size_factor: float | None = None
    inliers: int = 0
    fitness: float = 0.0
    alignment_score: float | None = None
    weight: float | None = None
    alike: tuple[NDArray[np.float64], ...] = ()

    def __repr__(self) -> str:
        """Name and numbers, without the poses."""
        weight = "" if self.weight is None else f", weight {self.weight:.2f}"
        return f"Retrieved({self.name}, P {self.probability:.2f}{weight})"


@dataclass(frozen=True)
class Outcome:
    """What an object was taken for.

    name : the stored object; None = none of them, or nothing is known
    how : "recognised", "similar" (it has that object's shape, stretched), "not in the prior",
        "retrieved" (a method that weighs no placements), or "" (one without a prior)
    weight : of that in the posterior, or the probability of what was retrieved
    size_factor : of a recognised object, over its stored size
    """

    name: str | None
    how: str
    weight: float | None
    size_factor: float | None

    @property
    def told(self) -> str:
        """In a word or two."""
        if self.name is None:
            return self.how
        return f"like {self.name}" if self.how == "similar" else self.name


@dataclass(frozen=True)
class Similar:
    """A stored object that an object which is none of them is like.

    scales : (3,) of its shape over the stored one, along the axes of its box as it rests, the last
    upright; weight : in the posterior, a part of that of "none of them"
    """

    name: str
    weight: float
    scales: tuple[float, float, float]


@dataclass(repr=False)
class ObjectReconstruction:
    """What is known of one object after inference.

    Attributes
    ----------
    status : "ok", or why there is no surface: "too_few_points", "no_surface", "failed"
    message : for people; may also qualify an "ok"
    n_points : valid observed points; observed : (n, 3) those points, and of earlier frames of a
    stream, metres, camera frame; center : (3,) centre of the box that bounds the former
    similar : what it is like, should it be none of them, heaviest first
    unknown_weight : of that in the posterior; None where it has none
    posterior, surface : None unless the object got that far
    unknown_probability : that the prior does not hold the object; 0 where retrieval cannot tell
    seconds : time of each stage
    memory : what its method wants to see again with the next frame of a stream
    """

    object_id: int
    status: str
    message: str = ""
    n_points: int = 0
    center: NDArray[np.float64] | None = None
    observed: NDArray[np.float32] | None = None
    retrieved: list[Retrieved] = field(default_factory=list)
    similar: list[Similar] = field(default_factory=list)
    unknown_probability: float = 0.0
    unknown_weight: float | None = None
    posterior: StoredPosterior | None = None
    surface: Surface | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    memory: Any = None

    @property
    def recognised(self) -> Retrieved | None:
        """The stored object that this one was taken for: the one that weighs more than a half; None
        where none does, or where placements are not verified."""
        heavy = [r for r in self.retrieved if r.weight is not None and r.weight > 0.5]
        return heavy[0] if heavy else None

    @property
    def outcome(self) -> Outcome:
        """What it was taken for, and how sure that is."""
        found = self.recognised
        if found is not None:
            return Outcome(found.name, "recognised", found.weight, found.size_factor)
        if self.like is not None:
            weight = sum(each.weight for each in self.similar)
            return Outcome(self.like.name, "similar", weight, None)
        if self.unknown_weight is not None:
            return Outcome(None, "not in the prior", self.unknown_weight, None)
        if self.retrieved:
            best = self.retrieved[0]
            return Outcome(best.name, "retrieved", best.probability, None)
        return Outcome(None, "", None, None)

    @property
    def like(self) -> Similar | None:
        """The stored object whose stretched shape this one's is; None where what it is like does
        not weigh more than a half."""
        return self.similar[0] if sum(each.weight for each in self.similar) > 0.5 else None

    @property
    def mean_uncertainty(self) -> float | None:
        """Over the vertices, metres; None without a surface, or in other units."""
        if self.surface is None or self.surface.uncertainty_unit != METRES:
            return None
        return float(self.surface.uncertainty.mean())

    def row(self) -> tuple[str, str, str, str, str, str]:
        """Id, what it was taken for, weight, size, mean uncertainty in mm, and status, as text."""
        outcome, spread = self.outcome, self.mean_uncertainty
        status = self.status + (f": {self.message}" if self.message else "")
        return (
            str(self.object_id),
            outcome.told or "-",
            "-" if outcome.weight is None else f"{outcome.weight:.2f}",
            "-" if outcome.size_factor is None else f"{outcome.size_factor:.2f}",
            "-" if spread is None else f"{spread * 1000:.1f}",
            status.split("\n")[0],
        )

    def __repr__(self) -> str:
        """One line, without the arrays."""
        object_id, name, weight, _, spread, status = self.row()
        return f"Object({object_id}: {name}, weight {weight}, ± {spread} mm, {status})"


@dataclass(frozen=True, repr=False)
class Reconstruction:
    """Everything that is known of a frame's objects, and how it came about.

    objects : one for each id in the mask, ascending; plane : the support plane, camera frame;
    retriever, prior_path, prior_digest : None where the method has no prior
    configuration : what decided the result, plain JSON
    segmentation : the same of the masks, where they were made on the way; else None
    seconds : time of the stages that concern the whole frame.
    image : what its method found of the image, whatever the masks, for other masks of it
    """

    frame: Frame
    objects: list[ObjectReconstruction]
    plane: Plane | None
    method: str
    retriever: str | None
    prior_path: Path | None
    prior_digest: str | None
    configuration: dict[str, Any]
    seed: int
    device: str
    seconds: dict[str, float] = field(default_factory=dict)
    segmentation: dict[str, Any] | None = None
    image: Any = None

    @property
    def reconstructed(self) -> list[ObjectReconstruction]:
        """The objects that have a surface."""
        return [o for o in self.objects if o.surface is not None]

    @property
    def title(self) -> str:
        """What was reconstructed, and how, in one line."""
        source = self.frame.source
        name = "a frame" if source is None else source.name
        by = f"retrieved by {self.retriever}" if self.retriever else "no prior"
        made = f"{len(self.reconstructed)} of {counted(len(self.objects), 'object')} of {name}"
        return f"{made}; {self.method}, {by}, seed {self.seed}"

    def __repr__(self) -> str:
        """Ten lines at most: what each object was taken for, without the arrays."""
        rows = [ROW, *(item.row() for item in self.objects)]
        widths = [max(len(row[i]) for row in rows) for i in range(len(ROW) - 1)]
        lines = [
            "  " + "  ".join([*map(str.ljust, row[:-1], widths), row[-1]]).rstrip() for row in rows
        ]
        left = len(lines) - (LINES - 1)
        if left > 0:
            lines[LINES - 2 :] = [f"  ... {left + 1} more: result.objects"]
        return "\n".join([self.title, *lines])

    def _repr_html_(self) -> str:
        """For notebooks: image and masks above the table of all objects."""
        from brrp_cli.notebook import picture_html, result_html, table_html
        from brrp_cli.segmentation.mask_picture import draw_masks

        picture = picture_html(draw_masks(self.frame.rgb, self.frame.segmap))
        return result_html(
            self.title, picture, table_html(ROW, [item.row() for item in self.objects])
        )
