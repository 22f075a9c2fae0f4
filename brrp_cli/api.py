"""From a frame, and a prior where the method has one, to every object's surface, in Python.

from brrp_cli import load_frame, open_prior, reconstruct
result = reconstruct(load_frame("frame.npz"), open_prior("prior/"))
result.objects[0].surface.as_trimesh()
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brrp_cli.config import Config, PointSDFConfig, VPrismConfig, preset
from brrp_cli.errors import BrrpError, PriorError, WeightsError
from brrp_cli.files import sha256_file
from brrp_cli.finite import check_object
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.methods.check_prior import check_prior
from brrp_cli.methods.registry import METHODS, RECONSTRUCTING
from brrp_cli.observation.ray_samples import ObjectObservation, observe
from brrp_cli.observation.support_plane import Plane
from brrp_cli.prior.store import Prior
from brrp_cli.progress import progress
from brrp_cli.reconstruction import FAILED, NO_SURFACE, OK, TOO_FEW_POINTS, ObjectReconstruction
from brrp_cli.retrieval.checked import CheckedRetriever
from brrp_cli.threads import cores, in_threads

if TYPE_CHECKING:
    from brrp_cli.retrieval.base import Retriever

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Reconstruction:
    """Everything that is known of a frame's objects, and how it came about.

    objects : one for each id in the mask, ascending; plane : the support plane, camera frame;
    retriever, prior_path, prior_digest : None where the method has no prior
    configuration : what decided the result, plain JSON
    seconds : time of the stages that concern the whole frame.
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

    @property
    def reconstructed(self) -> list[ObjectReconstruction]:
        """The objects that have a surface."""
        return [o for o in self.objects if o.surface is not None]


def pick_device(device: str) -> str:
    """`auto` is CUDA where there is one. Errors: BrrpError when CUDA is asked for in vain."""
    import torch

    if device == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    if device == "cuda" and not torch.cuda.is_available():
        raise BrrpError(
            "No CUDA device can be used",
            expected="a GPU and a CUDA build of torch",
            found=f"torch {torch.__version__}",
            fix="pass --device cpu, or install a CUDA build of torch",
        )
    return device


def reconstruct(
    frame: Frame,
    prior: Prior | None = None,
    *,
    method: str = "brrp",
    config: Config | None = None,
    retriever: Retriever | None = None,
    weights: str | Path | None = None,
    seed: int = 0,
    device: str = "auto",
    workers: int | None = None,
) -> Reconstruction:
    """Reconstruct every object of a segmented frame.

    method : "brrp", which needs a prior; "vprism", which has none and runs on the CPU; or
    "pointsdf", which needs `weights`, a file that tools/train_pointsdf.py wrote. The last two take
    the surface alone from `config`
    retriever : P(c|R); without one, CLIP if `BRRP_CLIP_DIR` is set or CLIP was fetched, else
    appearance. An object that cannot be reconstructed gets a status; the others still are. The
    frame is never changed. The same seed gives the same result, whatever the number of `workers`:
    objects at a time, by default as many as there are cores.

    Errors: BrrpError for an unknown method, or a prior, retriever or weights that it lacks or
    cannot use; PriorError for a shard that is damaged, when an object is read from it.
    """
    _check_method(method, prior, retriever, weights)
    config = config or preset("default")
    if weights is not None:
        return _pointsdf(frame, Path(weights), config, seed, pick_device(device))
    if prior is None:
        return _vprism(frame, config, seed)
    from brrp_cli.methods.brrp_default import reconstruct_by_hypotheses
    from brrp_cli.methods.brrp_paper import reconstruct_object
    from brrp_cli.retrieval.choose import choose_retriever

    check_prior(prior, config)
    device = pick_device(device)
    seconds: dict[str, float] = {}
    start = time.perf_counter()
    retriever = CheckedRetriever(
        retriever or choose_retriever("auto", prior, config, seed), len(prior.names)
    )
    seconds["retriever"] = time.perf_counter() - start
    start = time.perf_counter()
    workers = workers or cores()
    scene = observe(frame, config.observation, seed, workers)
    seconds["observation"] = time.perf_counter() - start

    def one(observation: ObjectObservation) -> ObjectReconstruction:
        if config.hypotheses is None:
            return reconstruct_object(
                frame, observation, prior, retriever, config, seed=seed, device=device
            )
        return reconstruct_by_hypotheses(
            frame, scene.plane, observation, prior, retriever, config, seed=seed, device=device
        )

    def whole(object_id: int) -> ObjectReconstruction:
        if object_id in scene.too_few:
            return _too_few(object_id, scene.too_few[object_id], config)
        return _whole(object_id, partial(one, scene.objects[object_id]), config)

    ids = frame.object_ids
    done = in_threads(whole, ids, workers)
    return Reconstruction(
        frame=frame,
        objects=list(progress(done, "objects", len(ids))),
        plane=scene.plane,
        method=method,
        retriever=retriever.name,
        prior_path=prior.path,
        prior_digest=prior.digest,
        configuration=config.as_dict(),
        seed=seed,
        device=device,
        seconds=seconds,
    )


def _check_method(
    method: str, prior: Prior | None, retriever: Retriever | None, weights: str | Path | None
) -> None:
    """BrrpError unless there is such a method and it has what it needs, and nothing else."""
    if method not in RECONSTRUCTING:
        raise BrrpError("No such method", found=method, expected=", ".join(RECONSTRUCTING))
    if METHODS[method].uses_prior and prior is None:
        raise PriorError(f"{method} needs a prior", fix="pass open_prior(PATH), or method='vprism'")
    if not METHODS[method].uses_prior and not (prior is None and retriever is None):
        raise BrrpError(
            f"{method} uses no prior", found="a prior or a retriever", fix="leave them out"
        )
    if METHODS[method].uses_weights and weights is None:
        raise WeightsError(
            f"{method} needs trained weights",
            fix="pass weights=FILE with a file that tools/train_pointsdf.py wrote",
        )
    if not METHODS[method].uses_weights and weights is not None:
        raise BrrpError(f"{method} was not trained", found="weights", fix="leave them out")


def _vprism(frame: Frame, config: Config, seed: int) -> Reconstruction:
    """The frame's objects in one map, without a prior; surfaces as `config` asks for them."""
    from brrp_cli.methods.vprism.method import reconstruct_scene
    from brrp_cli.observation.scene_samples import sample_scene

    own = VPrismConfig()
    start = time.perf_counter()
    scene = sample_scene(frame, own.observation, seed)
    seconds = {"observation": time.perf_counter() - start}
    surface = replace(config.surface, level=METHODS["vprism"].level(config))
    asked = replace(config, surface=surface)
    objects = [
        _whole(item.object_id, partial(_itself, item), asked)
        for item in progress(reconstruct_scene(scene, own, seed), "surfaces")
    ]
    return Reconstruction(
        frame=frame,
        objects=objects,
        plane=scene.plane,
        method="vprism",
        retriever=None,
        prior_path=None,
        prior_digest=None,
        configuration={**asdict(own), "surface": asdict(surface)},
        seed=seed,
        device="cpu",
        seconds=seconds,
    )


def _pointsdf(
    frame: Frame, weights: Path, config: Config, seed: int, device: str
) -> Reconstruction:
    """The frame's objects by a trained network; surfaces as `config` asks for them, but at the
    method's own level."""
    from brrp_cli.methods.pointsdf.method import reconstruct_pointsdf
    from brrp_cli.methods.pointsdf.weights import load_weights
    from brrp_cli.observation.ray_samples import box_center
    from brrp_cli.observation.support_plane import fit_plane

    own = PointSDFConfig()
    loaded = load_weights(weights)
    surface = replace(config.surface, level=METHODS["pointsdf"].level(config))
    asked = replace(config, surface=surface)
    objects = [
        _whole(item.object_id, partial(_itself, item), asked)
        for item in progress(
            reconstruct_pointsdf(frame, loaded.network.to(device), own), "surfaces"
        )
    ]
    # The network asks for no table; the picture does, to show the scene upright.
    background = frame.points[frame.valid & (frame.segmap == BACKGROUND)]
    seen = frame.points[frame.valid & (frame.segmap != BACKGROUND)]
    return Reconstruction(
        frame=frame,
        objects=objects,
        plane=fit_plane(background, config.observation, seed, box_center(seen))
        if len(seen)
        else None,
        method="pointsdf",
        retriever=None,
        prior_path=None,
        prior_digest=None,
        configuration={
            **asdict(own),
            "surface": asdict(surface),
            "network": asdict(loaded.network.config),
            "weights": {
                "path": str(weights),
                "sha256": sha256_file(weights),
                "training": loaded.training,
            },
        },
        seed=seed,
        device=device,
    )


def _too_few(object_id: int, count: int, config: Config) -> ObjectReconstruction:
    message = f"{count} valid depth points, {config.observation.min_points} are needed"
    return ObjectReconstruction(object_id, TOO_FEW_POINTS, message, n_points=count)


def _itself(item: ObjectReconstruction) -> ObjectReconstruction:
    return item


def _whole(
    object_id: int, infer: Callable[[], ObjectReconstruction], config: Config
) -> ObjectReconstruction:
    """The object with its surface, or with the status of having failed: whatever goes wrong with
    one object is no matter of the others."""
    try:
        result = infer()
        check_object(result)
        _add_surface(result, config)
    except PriorError:
        # A damaged prior is no fault of the object that comes upon it.
        raise
    except BrrpError as error:
        log.warning("Object %d: %s", object_id, error)
        return ObjectReconstruction(object_id, FAILED, str(error))
    except Exception as error:
        # A library stumbled: Open3D, SciPy and torch do, over shapes that nobody thought of.
        log.warning("Object %d: an error that brrp does not know: %r", object_id, error)
        log.debug("Object %d", object_id, exc_info=True)
        return ObjectReconstruction(
            object_id, FAILED, f"an error that brrp does not know: {error!r}"
        )
    return result


def _add_surface(result: ObjectReconstruction, config: Config) -> None:
    """Extract the surface of an object that has a posterior."""
    from brrp_cli.surface.extract import extract_surface

    if result.status != OK or result.posterior is None or result.observed is None:
        return
    start = time.perf_counter()
    result.surface = extract_surface(result.posterior, result.observed, config.surface)
    result.seconds["surface"] = time.perf_counter() - start
    if result.surface is None:
        result.status = NO_SURFACE
        result.message = "the map is occupied nowhere near the observed points"
