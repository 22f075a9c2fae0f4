"""Run variants on scenes: rows as they come, on from where a killed run was."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from brrp_cli.errors import BrrpError
from brrp_cli.evaluation.rows import OBJECT, Row, RowLog, finished, variant_columns, variant_of
from brrp_cli.evaluation.scenes import Scene
from brrp_cli.evaluation.true_meshes import prepare
from brrp_cli.evaluation.truth import TrueObject
from brrp_cli.evaluation.variants import Variant, same_results
from brrp_cli.prior.workers import run_tasks

# A scene takes minutes; what takes so long will not end.
TIME_LIMIT = 4 * 3600.0
FAILED = "failed"


@dataclass(frozen=True)
class Plan:
    """Everything that a worker has to know."""

    scenes: list[Scene]
    variants: list[Variant]
    data_root: Path
    cache: Path
    prior: Path | None = None
    clip_dir: Path | None = None
    noise: bool = False
    view: int = 0
    seed: int = 0
    device: str = "cpu"
    pictures: Path | None = None


def close_true_meshes(plan: Plan, workers: int) -> Iterator[tuple[TrueObject, BrrpError | None]]:
    """Close each true mesh of the scenes once; yields one of its objects as each is done.

    Errors: the first failure, if not one mesh could be closed.
    """
    meshes = {o.mesh_path: o for scene in plan.scenes for o in scene.objects}
    objects = [meshes[path] for path in sorted(meshes)]
    tasks = [(each, plan.data_root, plan.cache) for each in objects]
    failures = []
    for index, result in run_tasks(prepare, tasks, min(workers, len(tasks)), TIME_LIMIT):
        error = result if isinstance(result, BrrpError) else None
        if error is not None:
            failures.append(error)
            if len(failures) == len(objects):
                raise failures[0]
        yield objects[index], error


def run_missing(plan: Plan, log: RowLog, workers: int) -> Iterator[tuple[Scene, BrrpError | None]]:
    """Evaluate what the log does not hold yet; yields each scene as it ends, with the error of one
    whose worker died.

    A variant whose configuration equals that of an earlier one is not run again.
    """
    from brrp_cli.evaluation.evaluate_scene import evaluate_scene

    kept, complete = finished(log.read())
    log.replace(kept)
    to_run = dict.fromkeys(same_results(plan.variants).values())
    todo = []
    for scene in plan.scenes:
        missing = [variant for variant in to_run if (scene.name, variant) not in complete]
        if missing:
            todo.append((scene, missing))
        else:
            yield scene, None
    # A task carries its own scene alone.
    shared = replace(plan, scenes=[])
    tasks = [(shared, scene, missing, log.path) for scene, missing in todo]
    for index, result in run_tasks(evaluate_scene, tasks, min(workers, len(tasks)), TIME_LIMIT):
        yield todo[index][0], result if isinstance(result, BrrpError) else None


def collect(plan: Plan, log: RowLog, lost: Mapping[str, str]) -> list[Row]:
    """All rows, by scene, object and variant; one that says why for each view without rows.

    lost : scene -> what became of its worker
    """
    source = same_results(plan.variants)
    rows, complete = finished(log.read())
    rows += [
        lost_row(name, plan.view, variant, message)
        for name, message in lost.items()
        for variant in dict.fromkeys(source.values())
        if (name, variant) not in complete
    ]
    return in_order(rows, plan.variants, source)


def in_order(
    rows: Sequence[Row], variants: Sequence[Variant], source: dict[Variant, Variant]
) -> list[Row]:
    """Rows by scene, object and variant; what was run once for two names stands under both."""
    by_variant: dict[Variant, list[Row]] = {}
    for row in rows:
        by_variant.setdefault(variant_of(row), []).append(row)
    named = [
        {**row, **variant_columns(variant)}
        for variant in variants
        for row in by_variant.get(source[variant], [])
    ]
    # The sort is stable: variants stay in their order.
    return sorted(named, key=lambda row: (row["scene"], row["object_id"] or 0))


def lost_row(scene: str, view: int, variant: Variant, message: str) -> Row:
    """What stands for a view of which nothing is known."""
    found = dict.fromkeys(OBJECT) | {"scene": scene, "view": view, "objects_in_view": 1}
    return {**found, **variant_columns(variant), "status": FAILED, "message": message}
