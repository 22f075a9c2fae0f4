"""What `brrp reconstruct` tells of each object: one aligned table, with warnings where due."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from brrp_cli.reconstruction import OK

if TYPE_CHECKING:
    from brrp_cli.frames.frame import Frame
    from brrp_cli.observation.support_plane import Plane
    from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction

# Right placements score 0.8 and more; "not in the prior" counts as 0.7.
LOW_SCORE = 0.75
# The longest side, metres, of what stands on tables.
PLAUSIBLE = 0.01, 0.8
# Metres between the table and the lowest point of what stands on it; meshes end a little early.
OFF_TABLE = 0.03
_HEAD = ("id", "taken for", "weight", "size", "± mm", "s", "")
_RIGHT = ("id", "weight", "size", "± mm", "s")


@dataclass(frozen=True)
class Told:
    """What is told of one object.

    taken_for, how, weight, size_factor : as of `Outcome`
    uncertainty : mean over the mesh, metres; None in other units
    failed : whether it has no mesh
    """

    object_id: int
    status: str
    message: str
    taken_for: str | None
    how: str
    weight: float | None
    size_factor: float | None
    uncertainty: float | None
    seconds: float
    warnings: tuple[str, ...]
    failed: bool

    @property
    def name(self) -> str:
        """What it was taken for, in words; "-" where nothing is known."""
        name = self.taken_for or self.how or "-"
        if self.how == "retrieved":
            name += " (retrieved)"
        return f"like {name}" if self.how == "similar" else name

    def record(self) -> dict[str, Any]:
        """For --json; metres."""
        return {
            "id": self.object_id,
            "status": self.status,
            "message": self.message,
            "taken_for": self.taken_for,
            "how": self.how,
            "weight": self.weight,
            "size_factor": self.size_factor,
            "mean_uncertainty_m": self.uncertainty,
            "seconds": round(self.seconds, 3),
            "warnings": list(self.warnings),
        }


def told(result: Reconstruction) -> list[Told]:
    """All objects, in their order."""
    return [_told(item, result.frame, result.plane) for item in result.objects]


def _told(item: ObjectReconstruction, frame: Frame, plane: Plane | None) -> Told:
    outcome = item.outcome
    return Told(
        object_id=item.object_id,
        status=item.status,
        message=item.message,
        taken_for=outcome.name,
        how=outcome.how,
        weight=outcome.weight,
        size_factor=outcome.size_factor,
        uncertainty=item.mean_uncertainty,
        seconds=sum(item.seconds.values()),
        warnings=tuple(_warnings(item, frame, plane)),
        failed=item.surface is None,
    )


def _warnings(item: ObjectReconstruction, frame: Frame, plane: Plane | None) -> list[str]:
    """What speaks against trusting the object as it is."""
    found = []
    best = item.recognised
    if best is not None and best.alignment_score is not None and best.alignment_score < LOW_SCORE:
        found.append(f"low alignment score {best.alignment_score:.2f}")
    if best is None and item.unknown_weight is not None and item.unknown_weight < 0.5:
        found.append("no object has half of the weight")
    if item.surface is not None:
        from brrp_cli.ground_truth.pieces import count_pieces

        pieces = count_pieces(item.surface.as_trimesh())
        if pieces > 1:
            found.append(f"mesh in {pieces} pieces")
        longest = float(np.ptp(item.surface.vertices, axis=0).max())
        if not PLAUSIBLE[0] <= longest <= PLAUSIBLE[1]:
            found.append(f"{longest * 100:.3g} cm long: suspect the unit of depth")
        heights = [0.0] if plane is None else plane.signed_distance(item.surface.vertices)
        low, high = float(np.min(heights)), float(np.max(heights))
        if low > OFF_TABLE:
            found.append(f"{low * 100:.0f} cm above the table: on another object, or a wrong mask")
        elif high < 0:
            found.append(f"{-high * 100:.0f} cm below the table: a wrong mask")
    mask = frame.segmap == item.object_id
    if mask[[0, -1]].any() or mask[:, [0, -1]].any():
        found.append("mask at the image's border")
    return found


def lines(table: list[Told]) -> list[str]:
    """The table for a terminal, head first; colours are taken out where stdout is none."""
    rows = [_HEAD, *(_row(each) for each in table)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(_HEAD) - 1)]
    found = []
    for number, row in enumerate(rows):
        cells = [
            cell.rjust(width) if name in _RIGHT else cell.ljust(width)
            for name, cell, width in zip(_HEAD, row, widths, strict=False)
        ]
        text = "  " + "  ".join(cells)
        if number == 0:
            found.append(click.style(text.rstrip(), bold=True))
        else:
            colour = "yellow" if table[number - 1].status == OK else "red"
            notes = "  " + click.style(row[-1], fg=colour) if row[-1] else ""
            found.append((text + notes).rstrip())
    return found


def _row(each: Told) -> tuple[str, ...]:
    # Of a failure the log has told the rest.
    said = each.message.split("\n")[0]
    status = [] if each.status == OK else [each.status]
    return (
        str(each.object_id),
        each.name,
        "-" if each.weight is None else f"{each.weight:.2f}",
        "-" if each.size_factor is None else f"{each.size_factor:.2f}",
        "-" if each.uncertainty is None else f"{each.uncertainty * 1000:.1f}",
        f"{each.seconds:.1f}",
        "; ".join([*status, *([said] if said else []), *each.warnings]),
    )
