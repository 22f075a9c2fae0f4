"""No shapes: which objects of the prior are retrieved, for measuring retrieval alone."""

from __future__ import annotations

import time

from brrp_cli.frames.frame import Frame
from brrp_cli.prior.store import Prior
from brrp_cli.reconstruction import OK, ObjectReconstruction, Retrieved
from brrp_cli.retrieval.base import Retriever, top_k, unknown


def retrieve_objects(
    frame: Frame, prior: Prior, retriever: Retriever, k: int
) -> list[ObjectReconstruction]:
    """The k most probable stored objects for each object of the frame, not placed."""
    found = []
    for object_id in frame.object_ids:
        start = time.perf_counter()
        probabilities = retriever.probabilities(frame, object_id)
        found.append(
            ObjectReconstruction(
                object_id,
                OK,
                n_points=len(frame.object_points(object_id)),
                retrieved=[Retrieved(n, p) for n, p in top_k(probabilities, prior.names, k)],
                unknown_probability=unknown(probabilities),
                seconds={"retrieval": time.perf_counter() - start},
            )
        )
    return found
