"""The objects of a frame by the default preset, each by itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.methods.base import Setup, Stream
from brrp_cli.methods.brrp_default import reconstruct_by_hypotheses
from brrp_cli.methods.each_object import checked, guarded
from brrp_cli.methods.earlier_views import EarlierViews
from brrp_cli.methods.scene import SeenScene
from brrp_cli.methods.shared_work import each_shared, shared_work
from brrp_cli.observation.ray_samples import SampledScene
from brrp_cli.reconstruction import ObjectReconstruction
from brrp_cli.retrieval.base import Retriever, helped
from brrp_cli.threads import cores


@dataclass(frozen=True)
class _Objects:
    """sampled : the scene; stream : of which its frame is one"""

    scene: SeenScene
    sampled: SampledScene
    stream: Stream | None


@contextmanager
def by_hypotheses(
    scene: SeenScene, sampled: SampledScene, retriever: Retriever, setup: Setup
) -> Iterator[Callable[[int], ObjectReconstruction]]:
    """Reconstructs the object of an id that has enough points; what goes wrong with one is told of
    it alone. Errors: PriorError."""
    stream = setup.stream
    # Earlier frames are more to send than a helper would save.
    helpers = None if stream is not None and any(stream.earlier.values()) else setup.helpers
    assert setup.retriever is not None
    each = each_shared(scene, setup.helpers, setup.workers or cores())
    with (
        helped(setup.retriever, each),
        shared_work(_reconstructed, _Objects(scene, sampled, stream), scene, helpers) as work,
    ):

        def retrieved(object_id: int) -> ObjectReconstruction:
            return work(object_id, retriever.probabilities(scene.frame, object_id))

        yield lambda object_id: guarded(object_id, lambda: retrieved(object_id))


def _reconstructed(
    objects: _Objects, object_id: int, probabilities: NDArray[np.float64]
) -> ObjectReconstruction:
    scene, stream, earlier = objects.scene, objects.stream, None
    if stream is not None:
        earlier = EarlierViews.of(stream.earlier.get(object_id, ()), stream.config)
    observation = objects.sampled.observation(object_id)
    item = reconstruct_by_hypotheses(scene, observation, probabilities, earlier=earlier)
    return checked(item, scene.config.surface)
