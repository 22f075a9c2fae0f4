"""How many connected pieces a mesh has."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import trimesh


def count_pieces(mesh: trimesh.Trimesh) -> int:
    """Connected parts of the surface: faces that share a vertex are in one. A cavity is a part of
    its own."""
    from trimesh.graph import connected_component_labels

    labels = connected_component_labels(mesh.edges, node_count=len(mesh.vertices))
    # Vertices without a face are no pieces, which trimesh's body_count takes them for.
    return len(np.unique(labels[mesh.faces[:, 0]]))
