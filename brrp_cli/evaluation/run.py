"""Run variants on scenes: rows as they come, on from where a killed run was."""

from __future__ import annotations

import logging
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from brrp_cli.errors import BrrpError
from brrp_cli.evaluation.evaluate_scene import evaluate_scene
from brrp_cli.evaluation.rows import Row, RowLog, finished, variant_columns, variant_of
from brrp_cli.evaluation.variants import Variant, same_results
from brrp_cli.evaluation.work import Plan, lost_row
from brrp_cli.executors.executor import Executor
from brrp_cli.ground_truth.scenes import Scene
from brrp_cli.ground_truth.true_meshes import close_truth
from brrp_cli.ground_truth.truth import TrueObject

# A scene takes minutes; what takes so long will not end.
TIME_LIMIT = 4 * 3600.0


@dataclass(frozen=True)
class Remaining:
    """What is still to do: true meshes to close (one object of each file), scenes to evaluate."""

    meshes: list[TrueObject]
    scenes: list[tuple[Scene, list[Variant]]]

    def __len__(self) -> int:
        return len(self.meshes) + len(self.scenes)


def remaining(plan: Plan, log: RowLog) -> Remaining:
    """What the log does not hold yet; views that a killed run left half done are dropped from it.

    A variant whose configuration equals that of an earlier one is not run.
    """
    kept, complete = finished(log.read())
    log.replace(kept)
    to_run = dict.fromkeys(same_results(plan.variants).values())
    scenes = []
    for scene in plan.scenes:
        missing = [variant for variant in to_run if (scene.name, variant) not in complete]
        if missing:
            scenes.append((scene, missing))
    meshes = {o.mesh_path: o for scene, _ in scenes for o in scene.objects}
    return Remaining(list(meshes.values()), scenes)


def run_remaining(
    plan: Plan, log: RowLog, todo: Remaining, executor: Executor
) -> Generator[tuple[TrueObject | Scene, BrrpError | None], None, None]:
    """Do it: meshes first. Yields what has ended, with its error: a mesh that cannot be closed, a
    scene whose worker died. Errors: the first mesh's, if not one of them can be closed.
    """
    # A task carries its own scene alone.
    shared = replace(plan, scenes=[])
    tasks: list[tuple[Any, ...]] = [(shared, each) for each in todo.meshes]
    tasks += [(shared, scene, variants, log.path) for scene, variants in todo.scenes]
    unusable = []
    reads = [*dict.fromkeys(scene.folder.parent for scene in plan.scenes), plan.data_root]
    reads += [path for path in (plan.prior, *plan.weights.values()) if path is not None]
    results = executor.run(_work, tasks, TIME_LIMIT, reads=reads, writes=log.path.parent)
    for index, result in results:
        error = result if isinstance(result, BrrpError) else None
        if index >= len(todo.meshes):
            yield todo.scenes[index - len(todo.meshes)][0], error
            continue
        if error is not None:
            unusable.append(error)
            if len(unusable) == len(todo.meshes):
                raise unusable[0]
        yield todo.meshes[index], error


def _work(plan: Plan, what: TrueObject | Scene, *rest: Any) -> None:
    """One task of a worker: a true mesh, or a scene with its variants and the log."""
    # What goes wrong is in the rows; what is worth a note to one who reconstructs is not here.
    logging.getLogger().setLevel(logging.ERROR)
    if isinstance(what, Scene):
        evaluate_scene(plan, what, *rest)
    else:
        close_truth(what, plan.data_root, plan.cache)


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
