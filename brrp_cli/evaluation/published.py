"""The table of the paper, to stand beside ours."""

from __future__ import annotations

COLUMNS = (
    "method",
    "IoU ShapeNet",
    "IoU YCB",
    "Chamfer ShapeNet, cm",
    "Chamfer YCB, cm",
    "Chamfer Objaverse, cm",
)

# Wright et al., "Robust Bayesian Scene Reconstruction with Retrieval-Augmented Priors": IoU from
# its table, Chamfer distances on ShapeNet read off its bar chart. None: not published.
TABLE: dict[str, tuple[float | None, ...]] = {
    "V-PRISM": (0.3092, 0.5003, 1.08, 1.24, 1.83),
    "PointSDF (ShapeNet)": (0.3600, 0.4601, 1.04, 1.54, 2.50),
    "PointSDF (YCB)": (0.2426, 0.5088, None, None, None),
    "BRRP": (0.3124, 0.5277, 1.01, 1.05, 1.70),
}
