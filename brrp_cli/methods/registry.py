"""The methods by name: each takes a frame and gives what it knows of every object in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brrp_cli.config import Config, PointSDFConfig, VPrismConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.reconstruction import ObjectReconstruction

if TYPE_CHECKING:
    from brrp_cli.methods.pointsdf.network import PointSDF
    from brrp_cli.prior.store import Prior
    from brrp_cli.retrieval.base import Retriever


HALF = 0.5


@dataclass(frozen=True)
class Setup:
    """What a method may need besides the frame; prior and retriever only where it uses a prior,
    weights where it was trained."""

    config: Config
    seed: int
    device: str = "cpu"
    prior: Prior | None = None
    retriever: Retriever | None = None
    weights: Path | None = None


@dataclass(frozen=True)
class Method:
    """run : all objects of a frame, by id; configuration : what decides its results, plain JSON;
    uses_prior : whether presets, k and retrievers mean something to it; gives_shapes : whether it
    reconstructs, or is there to be measured alone; uses_weights : whether it was trained;
    uses_cuda : whether it runs there too; level : occupancy at its surface."""

    run: Callable[[Frame, Setup], list[ObjectReconstruction]]
    configuration: Callable[[Config], dict[str, Any]]
    uses_prior: bool
    gives_shapes: bool = True
    uses_weights: bool = False
    uses_cuda: bool = True
    level: Callable[[Config], float] = lambda config: HALF


def _brrp(frame: Frame, setup: Setup) -> list[ObjectReconstruction]:
    from brrp_cli.api import reconstruct

    assert setup.prior is not None
    result = reconstruct(
        frame,
        setup.prior,
        config=setup.config,
        retriever=setup.retriever,
        seed=setup.seed,
        device=setup.device,
        # Scenes are shared out among processes.
        workers=1,
    )
    for item in result.objects:
        share = result.seconds["observation"] / len(result.objects)
        item.seconds = {"observation": share, **item.seconds}
    return result.objects


def _retrieval(frame: Frame, setup: Setup) -> list[ObjectReconstruction]:
    from brrp_cli.methods.retrieval_only import retrieve_objects

    assert setup.prior is not None and setup.retriever is not None
    return retrieve_objects(frame, setup.prior, setup.retriever, setup.config.k)


def _vprism(frame: Frame, setup: Setup) -> list[ObjectReconstruction]:
    from brrp_cli.methods.vprism.method import reconstruct_vprism

    return reconstruct_vprism(frame, VPrismConfig(), setup.seed)


def _vprism_configuration(config: Config) -> dict[str, Any]:
    return asdict(VPrismConfig())


def _pointsdf(frame: Frame, setup: Setup) -> list[ObjectReconstruction]:
    from brrp_cli.api import pick_device
    from brrp_cli.methods.pointsdf.method import reconstruct_pointsdf

    assert setup.weights is not None
    network = _network(setup.weights, pick_device(setup.device))
    return reconstruct_pointsdf(frame, network, PointSDFConfig())


@lru_cache(maxsize=4)
def _network(weights: Path, device: str) -> PointSDF:
    """Read once for all frames of a process."""
    from brrp_cli.methods.pointsdf.weights import load_weights

    return load_weights(weights).network.to(device)


def _pointsdf_configuration(config: Config) -> dict[str, Any]:
    return asdict(PointSDFConfig())


METHODS = {
    "brrp": Method(
        _brrp, Config.as_dict, uses_prior=True, level=lambda config: config.surface.level
    ),
    "retrieval": Method(_retrieval, Config.as_dict, uses_prior=True, gives_shapes=False),
    "vprism": Method(_vprism, _vprism_configuration, uses_prior=False, uses_cuda=False),
    "pointsdf": Method(
        _pointsdf,
        _pointsdf_configuration,
        uses_prior=False,
        uses_weights=True,
        level=lambda config: PointSDFConfig().level,
    ),
}

# Those that reconstruct.
RECONSTRUCTING = tuple(name for name, method in METHODS.items() if method.gives_shapes)
