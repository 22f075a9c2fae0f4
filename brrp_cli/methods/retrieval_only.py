"""No shapes: which objects of the prior are retrieved, for measuring retrieval alone."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from brrp_cli.config import PRESETS, Config
from brrp_cli.methods.base import Method, Setup
from brrp_cli.methods.configuration import as_record

if TYPE_CHECKING:
    from brrp_cli.frames.frame import Frame
    from brrp_cli.prior.store import Prior
    from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction
    from brrp_cli.retrieval.base import Retriever


def run(frame: Frame, setup: Setup) -> Reconstruction:
    """The k most probable stored objects for each object of the frame, not placed."""
    from brrp_cli.methods.each_object import share_retrieval
    from brrp_cli.reconstruction import Reconstruction

    config, prior, retriever = setup.config, setup.prior, setup.retriever
    assert isinstance(config, Config) and prior is not None and retriever is not None
    start = time.perf_counter()
    objects = [_retrieve(frame, i, prior, retriever, config.k) for i in frame.object_ids]
    share_retrieval(objects, time.perf_counter() - start)
    return Reconstruction(
        frame=frame,
        objects=objects,
        plane=None,
        method=METHOD.name,
        retriever=retriever.name,
        prior_path=prior.path,
        prior_digest=prior.digest,
        configuration=as_record(config),
        seed=setup.seed,
        device="cpu",
    )


def _retrieve(
    frame: Frame, object_id: int, prior: Prior, retriever: Retriever, k: int
) -> ObjectReconstruction:
    from brrp_cli.reconstruction import OK, ObjectReconstruction, Retrieved
    from brrp_cli.retrieval.base import top_k, unknown

    probabilities = retriever.probabilities(frame, object_id)
    return ObjectReconstruction(
        object_id,
        OK,
        n_points=len(frame.object_points(object_id)),
        retrieved=[Retrieved(n, p) for n, p in top_k(probabilities, prior.names, k)],
        unknown_probability=unknown(probabilities),
    )


METHOD = Method(
    name="retrieval",
    summary="no shapes: which objects of the prior are retrieved",
    presets=PRESETS,
    run=run,
    uses_prior=True,
    uses_retriever=True,
    gives_shapes=False,
)
