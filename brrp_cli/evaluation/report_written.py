"""The head of report.md: the meshes that a user gets, against the exact ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from brrp_cli.evaluation.markdown import Column, figure, table
from brrp_cli.evaluation.summary import VariantSummary
from brrp_cli.evaluation.variants import Variant
from brrp_cli.evaluation.written_figures import ALL
from brrp_cli.ground_truth.thickness import SHELL, SOLID, THIN

GROUP_NAMES = {
    ALL: "all",
    SHELL: "shells, under 5 mm",
    THIN: "thin, under 25 mm",
    SOLID: "solid",
}
DISTANCES: list[Column] = [
    ("distance, mm", "surface_distance", 1000, 2),
    ("median, mm", "surface_distance_median", 1000, 2),
    ("F 2 mm", "f_score_2mm", 1, 3),
    ("F 5 mm", "f_score_5mm", 1, 3),
    ("F 10 mm", "f_score_10mm", 1, 3),
    ("volume ratio", "volume_ratio", 1, 2),
    ("median", "volume_ratio_median", 1, 2),
    ("within 10 %", "volume_within_10", 1, 3),
    ("within 25 %", "volume_within_25", 1, 3),
    ("closed", "watertight", 1, 3),
    ("one piece", "one_piece", 1, 3),
    ("pieces", "pieces", 1, 2),
    ("ECE, occluded", "ece_occluded", 1, 4),
    ("NLL, occluded", "nll_occluded", 1, 3),
]
SIDES: list[Column] = [
    ("mesh to truth, mm", "distance_to_truth", 1000, 2),
    ("truth to mesh, mm", "distance_from_truth", 1000, 2),
    ("seen sides, mm", "surface_distance_seen", 1000, 2),
    ("unseen sides, mm", "surface_distance_unseen", 1000, 2),
    ("bias, mm", "surface_bias", 1000, 2),
    ("bias, seen", "surface_bias_seen", 1000, 2),
    ("bias, unseen", "surface_bias_unseen", 1000, 2),
    ("normals", "normal_consistency", 1, 3),
    ("normals, seen", "normal_consistency_seen", 1, 3),
]
WRITTEN_NOTES = """\
- The written mesh is the one that `brrp reconstruct` writes; the exact mesh is the true mesh,
  repaired, neither thickened nor smoothed. 4,000 points of either surface, uniform by area, against
  the nearest point of the other's triangles: distance is the mean of both directions' means, F the
  harmonic mean of the shares within 2, 5 and 10 mm. Volume ratio: written over true, of closed
  meshes. One piece: no more connected pieces than the true mesh. An object without a mesh has F 0
  and counts as not closed, not in one piece and of the wrong volume; means of distances and of
  volumes leave it out.
- Shells, thin and solid objects: by the median thickness of the true mesh along its inward
  normals.
- Seen sides: points of the true surface that the camera's rays meet first, in the object's mask,
  and points of the mesh nearest to such points. Bias: mean signed distance of the mesh to the true
  surface, above 0 where the mesh lies outside. Normals: mean |cos| between the normals at nearest
  points.
"""

Labels = Mapping[Variant, str]


def written_sections(summaries: Sequence[VariantSummary], labels: Labels) -> list[str]:
    """Headings and tables; nothing where no variant gives shapes."""
    if not any(summary.written for summary in summaries):
        return []
    return [
        "## The written mesh against the exact mesh",
        _by_group(summaries, labels, DISTANCES),
        "Where it is off, and to which side:",
        _by_group(summaries, labels, SIDES),
    ]


def _by_group(
    summaries: Sequence[VariantSummary], labels: Labels, columns: Sequence[Column]
) -> str:
    """A row for each variant and each group of objects."""
    rows = [
        [
            labels[summary.variant],
            GROUP_NAMES[group],
            *(figure(found.figures[name], factor, digits) for _, name, factor, digits in columns),
            str(found.objects),
            str(found.without_mesh),
        ]
        for summary in summaries
        for group, found in summary.written.items()
    ]
    headings = ["", "objects", *(heading for heading, *_ in columns), "number", "without mesh"]
    return table(headings, rows)
