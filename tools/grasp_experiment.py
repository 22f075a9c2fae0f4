"""Carry out planned grasps in MuJoCo on the true objects of made scenes, and count what holds.

    python tools/make_scenes.py --meshes ycb --seed 52000 --noise structured-light -o SCENES
    python tools/grasp_experiment.py prior=SCENES --prior prior/ --data-root data/ -o grasps.jsonl
    python tools/grasp_experiment.py --report grasps.jsonl

For each object: the three best grasps of each method that `brrp grasp` gives, and of `default`
another one, drawn at random among all that it can plan, so that low scores are tried as well. A
floating hand of boxes with limited force comes in from the pre-grasp, closes, lifts by 20 cm and
shakes, open loop. It misses its pose by as much as the planner's score counts with; the same errors
for all methods. A grasp holds if the object is still in the hand at the end. A scene and method of
which there are rows is not run again: what was stopped goes on, and methods may come later. --film
draws the first grasps of this run that held, and the first that failed in each way.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from grasp_trial.bodies import true_body
from grasp_trial.film import Film, Take
from grasp_trial.methods import DEFAULT, METHODS, POINTSDF, scenes_of
from grasp_trial.report import report
from grasp_trial.trial import Trials, misplaced
from one_message import one_message

from brrp_cli.config.grasping import GraspConfig
from brrp_cli.grasping.grasp import Grasp
from brrp_cli.grasping.gripper import Gripper
from brrp_cli.grasping.gripper_file import DEFAULT as HAND
from brrp_cli.grasping.gripper_file import open_gripper
from brrp_cli.grasping.plan import plan_grasps
from brrp_cli.ground_truth.scenes import Scene, find_scenes
from brrp_cli.ground_truth.true_meshes import truth_cache
from brrp_cli.seeds import child_rng

# Fewer pixels of an object are no view of it.
MIN_PIXELS = 200
PER_OBJECT = 40
# Ranks of the grasps that are carried out, best first; another one may be drawn.
RANKS = (1, 2, 3)
DRAWN = "drawn"
# Of an object that does not stand by itself no grasp is counted, metres.
DRIFT = 0.005


@click.command()
@click.argument("sets", nargs=-1, metavar="NAME=SCENES...")
@click.option("--prior", "prior_path", type=click.Path(path_type=Path))
@click.option("--data-root", type=click.Path(path_type=Path), help="Mesh paths are relative to it.")
@click.option("--methods", default=",".join(METHODS), show_default=True, help="Also pointsdf.")
@click.option("--weights", type=click.Path(path_type=Path), help="Of pointsdf. [its own]")
@click.option("--gripper", default=HAND, show_default=True)
@click.option("--friction", default=GraspConfig.friction, show_default=True, help="Of both.")
@click.option("--first", type=click.IntRange(1), help="Scenes of each set.")
@click.option("--seed", default=0, show_default=True)
@click.option("--cache", type=click.Path(path_type=Path), help="Of true meshes and their parts.")
@click.option("--report", "report_of", type=click.Path(path_type=Path), help="Only tell a file.")
@click.option("--film", "film_of", type=click.Path(path_type=Path), help="PNG of some grasps.")
@click.option("-o", "--output", type=click.Path(path_type=Path))
@one_message()
def main(
    sets: tuple[str, ...],
    prior_path: Path | None,
    data_root: Path | None,
    methods: str,
    weights: Path | None,
    gripper: str,
    friction: float,
    first: int | None,
    seed: int,
    cache: Path | None,
    report_of: Path | None,
    film_of: Path | None,
    output: Path | None,
) -> None:
    """Plan grasps in each scene of SETS by each method, carry them out, write a row for each."""
    if report_of is not None:
        click.echo(report(_rows(report_of), DRIFT))
        return
    chosen = tuple(name.strip() for name in methods.split(","))
    known = (*METHODS, POINTSDF)
    if output is None or not sets or set(chosen) - set(known):
        raise click.UsageError(f"name sets, -o FILE, and --methods of {', '.join(known)}")
    film = None if film_of is None else Film()
    prior, retriever = _open(prior_path, seed)
    hand = open_gripper(gripper)
    done = {(row["scene"], row["method"]) for row in _rows(output)}
    for text in sets:
        name, _, folder = text.partition("=")
        for scene in find_scenes(Path(folder), slice(0, first)):
            label = f"{name}/{scene.name}"
            missing = tuple(method for method in chosen if (label, method) not in done)
            if not missing:
                continue
            start = time.perf_counter()
            rows = list(
                _scene_rows(
                    scene,
                    name,
                    missing,
                    hand,
                    friction,
                    seed,
                    data_root,
                    cache or truth_cache(),
                    prior,
                    retriever,
                    weights,
                    film,
                )
            )
            with output.open("a") as stream:
                stream.writelines(json.dumps(row) + "\n" for row in rows)
            if film is not None and film_of is not None:
                film.save(film_of)
            held = sum(row["result"] == "held" for row in rows)
            seconds = time.perf_counter() - start
            click.echo(f"{label}: {len(rows)} rows, {held} held, {seconds:.0f} s", err=True)
    click.echo(report(_rows(output), DRIFT))


def _rows(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def _open(path: Path | None, seed: int) -> tuple[Any, Any]:
    if path is None:
        return None, None
    from brrp_cli.config import preset
    from brrp_cli.prior.store import open_prior
    from brrp_cli.retrieval.choose import choose_retriever

    prior = open_prior(path)
    return prior, choose_retriever("appearance", prior, preset("default"), seed)


def _scene_rows(
    scene: Scene,
    name: str,
    methods: tuple[str, ...],
    hand: Gripper,
    friction: float,
    seed: int,
    data_root: Path | None,
    cache: Path,
    prior: Any,
    retriever: Any,
    weights: Path | None,
    film: Film | None,
) -> Iterator[dict[str, Any]]:
    """A row for each grasp that is carried out, and for each object without one."""
    frame = scene.view(0)
    assert frame.T_world_cam is not None
    bodies = [true_body(item, data_root, cache) for item in scene.objects]
    trials = Trials(bodies, hand, friction)
    told = scenes_of(methods, frame, bodies, prior, retriever, seed, weights)
    config = replace(GraspConfig(), friction=friction)
    seen = [i for i in frame.object_ids if int((frame.segmap == i).sum()) >= MIN_PIXELS]
    for method, view in told.items():
        start = time.process_time()
        plan = plan_grasps(view, hand, config=config, seed=seed, workers=1)
        seconds = time.process_time() - start
        of = {each.object_id: each for each in plan.objects}
        more = {}
        if method == DEFAULT:
            all_of_them = plan_grasps(
                view, hand, config=config, per_object=PER_OBJECT, min_score=0.0, seed=seed
            )
            more = {each.object_id: each.grasps for each in all_of_them.objects}
        for object_id in seen:
            grasps = of[object_id].grasps if object_id in of else []
            others = more.get(object_id, [])[len(RANKS) :]
            row = {
                "set": name,
                "scene": f"{name}/{scene.name}",
                "object": object_id,
                "method": method,
                "plan_cpu_seconds": seconds,
            }
            if not grasps:
                why = of[object_id].why if object_id in of else "it has no mesh"
                none = {"result": "none", "why": why, "score": None}
                none["drift"] = trials.drift[object_id]
                yield row | {"rank": RANKS[0]} | none
            tried: dict[int | str, Grasp] = dict(zip(RANKS, grasps, strict=False))
            if others:
                rng = child_rng(seed, "trial", scene.name, object_id)
                tried[DRAWN] = others[int(rng.integers(len(others)))]
            for rank, grasp in tried.items():
                T = misplaced(
                    frame.T_world_cam @ grasp.T_cam_gripper,
                    config.accuracy,
                    config.accuracy_angle,
                    child_rng(seed, "miss", scene.name, object_id, rank),
                )
                yield row | {"rank": rank} | _carried_out(trials, grasp, T, config, method, film)


def _carried_out(
    trials: Trials,
    grasp: Grasp,
    T: Any,
    config: GraspConfig,
    method: str,
    film: Film | None,
) -> dict[str, Any]:
    take = Take(trials.model, f"object_{grasp.object_id}", (T @ [0, 0, trials.gripper.tip, 1])[:3])
    outcome = trials.attempt(grasp.object_id, T, grasp.opening, config.approach, take)
    if film is not None and outcome.drift <= DRIFT and film.wants(outcome.result):
        film.add(f"{method}, score {grasp.score:.2f}", outcome.result, take)
    return {
        "result": outcome.result,
        "score": grasp.score,
        "quality": grasp.quality,
        "width": grasp.width,
        "drift": outcome.drift,
    }


if __name__ == "__main__":
    main()
