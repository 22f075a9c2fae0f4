"""Object by object: whatever goes wrong with one is no matter of the others."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence

from brrp_cli.config import SurfaceConfig
from brrp_cli.errors import BrrpError, PriorError
from brrp_cli.finite import check_finite
from brrp_cli.reconstruction import FAILED, NO_SURFACE, OK, TOO_FEW_POINTS, ObjectReconstruction
from brrp_cli.surface.extract import extract_surface

log = logging.getLogger(__name__)


def with_surface(
    object_id: int, infer: Callable[[], ObjectReconstruction], surface: SurfaceConfig
) -> ObjectReconstruction:
    """What `infer` says of one object, with its surface, `guarded`."""
    return guarded(object_id, lambda: checked(infer(), surface))


def surfaced(item: ObjectReconstruction, surface: SurfaceConfig) -> ObjectReconstruction:
    """An object that was inferred, with its surface, `guarded`."""
    return with_surface(item.object_id, lambda: item, surface)


def guarded(
    object_id: int, make: Callable[[], ObjectReconstruction], level: int = logging.WARNING
) -> ObjectReconstruction:
    """What `make` gives of one object, or the status of having failed, which the log tells at that
    level.

    Errors: PriorError, since a damaged prior is no fault of the object that comes upon it.
    """
    try:
        return make()
    except PriorError:
        raise
    except BrrpError as error:
        log.log(level, "Object %d: %s", object_id, error)
        return ObjectReconstruction(object_id, FAILED, str(error))
    except Exception as error:
        # A library stumbled: Open3D, SciPy and torch do, over shapes that nobody thought of.
        log.log(level, "Object %d: an error that brrp does not know: %r", object_id, error)
        log.debug("Object %d", object_id, exc_info=True)
        message = f"an error that brrp does not know: {error!r} (--verbose shows the traceback)"
        return ObjectReconstruction(object_id, FAILED, message)


def checked(result: ObjectReconstruction, surface: SurfaceConfig) -> ObjectReconstruction:
    """What was inferred of one object, with its surface. Errors: BrrpError for numbers that are not
    finite."""
    _check_finite(result)
    _add_surface(result, surface)
    return result


def too_few(object_id: int, count: int, needed: int) -> ObjectReconstruction:
    """An object of `count` points where `needed` are the least that the method works with."""
    message = f"{count} valid depth points, {needed} are needed"
    return ObjectReconstruction(object_id, TOO_FEW_POINTS, message, n_points=count)


def share_retrieval(objects: Sequence[ObjectReconstruction], seconds: float) -> None:
    """Give each object an equal share of the seconds that retrieval took: its first answer about a
    frame is the work of all objects. Those of too few points are not asked about."""
    asked = [item for item in objects if item.status != TOO_FEW_POINTS]
    for item in asked:
        item.seconds = {"retrieval": seconds / len(asked), **item.seconds}


def _add_surface(result: ObjectReconstruction, config: SurfaceConfig) -> None:
    """Extract the surface of an object that has a posterior."""
    if result.status != OK or result.posterior is None or result.observed is None:
        return
    start = time.perf_counter()
    result.surface = extract_surface(result.posterior, result.observed, config)
    result.seconds["surface"] = time.perf_counter() - start
    if result.surface is None:
        result.status = NO_SURFACE
        result.message = "the map is occupied nowhere near the observed points"


def _check_finite(item: ObjectReconstruction) -> None:
    """All that inference says of one object but its posterior, which is evaluated where the
    surface is looked for."""
    check_finite(
        "Inference",
        center=item.center,
        observed=item.observed,
        unknown_probability=item.unknown_probability,
        unknown_weight=item.unknown_weight,
    )
    for found in item.retrieved:
        check_finite(
            f"Registration of {found.name}",
            probability=found.probability,
            T_cam_object=found.T_cam_object,
            T_cam_mesh=found.T_cam_mesh,
            alike=found.alike,
            size_factor=found.size_factor,
            fitness=found.fitness,
            alignment_score=found.alignment_score,
            weight=found.weight,
        )
