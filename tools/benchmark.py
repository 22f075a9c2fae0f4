"""Time frames stage by stage, against a plain implementation of the paper's steps.

    python tools/benchmark.py                               # a made frame of four objects
    python tools/benchmark.py --prior prior/ a.npz b.npz    # and other frames
    python tools/benchmark.py --quick                       # one repeat, one plain object
    python tools/benchmark.py --json history.jsonl --growth
    python tools/benchmark.py --no-made --prior prior/ --set stereo=scenes/ --set real=frames/

The made frame is that of `brrp demo`, its first four objects, with the starter prior. Every frame
is first reconstructed once, then `--repeats` times: medians, least and greatest. Stages are those
of one thread; the whole is timed with one thread and with `--workers`, whose helper processes are
ready by then, and their CPU counts, too. The plain implementation
(tools/plain) gets all cores; a machine that is busy disturbs both, so read the ratios. `cold` is
`brrp reconstruct FRAME` as a process of its own, imports included. Denormal numbers, which some
processors multiply 20 times more slowly and others at full speed, are counted by the folder of
brrp_cli that made them. With --json a line is appended.

A set is a folder of frames (*.npz) or of scenes, whose first views are taken: one row of a table
over its frames. With --make-masks, masks are made of depth, and the time counts. `busy` is how many
times as many CPU seconds one thread takes where the other cores are kept busy.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message
from plain.reconstruct import STAGES, reconstruct_plainly
from speed.denormals import by_folder, watch_denormals
from speed.frames import four_objects, with_objects
from speed.growth import cases
from speed.machine import Machine, limits, measure_machine
from speed.measure import cold_reconstruct, own_megabytes, peak_megabytes, run, spread
from speed.sets import HEAD, frames_of, measure_set

from brrp_cli.config import preset
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.npz import save_frame
from brrp_cli.frames.readers import read_frame
from brrp_cli.observation.ray_samples import observe
from brrp_cli.prior.store import Prior, open_prior
from brrp_cli.reconstruction import Reconstruction
from brrp_cli.retrieval.choose import choose_retriever
from brrp_cli.session import Reconstructor
from brrp_cli.threads import cores
from brrp_cli.version import __version__

MADE = "made, four objects"


@dataclass(frozen=True)
class Options:
    """What is asked for on the command line."""

    repeats: int
    workers: int
    plain_objects: int | None
    cold: bool


@click.command()
@click.argument("frame_paths", nargs=-1, type=click.Path(path_type=Path))
@click.option("--prior", "prior_path", type=click.Path(path_type=Path), help="[the starter prior]")
@click.option("--made/--no-made", default=True, help="Time the made frame too.")
@click.option("--repeats", default=5, show_default=True, type=click.IntRange(1))
@click.option("--workers", type=click.IntRange(1), help="Threads of the whole. [default: cores]")
@click.option("--plain-objects", type=click.IntRange(0), help="Of each frame. [default: all]")
@click.option("--cold/--no-cold", default=True)
@click.option("--growth", is_flag=True, help="With objects, pixels, particles, ...")
@click.option("--set", "sets", multiple=True, metavar="NAME=FOLDER", help="A row of its own.")
@click.option(
    "--set-frames", default=6, show_default=True, type=click.IntRange(1), help="Of a set."
)
@click.option("--make-masks", is_flag=True, help="Those of sets, anew.")
@click.option("--quick", is_flag=True, help="One repeat, one plain object, less growth.")
@click.option("--json", "history", type=click.Path(path_type=Path), help="Append a line here.")
@one_message()
def main(
    frame_paths: tuple[Path, ...],
    prior_path: Path | None,
    made: bool,
    repeats: int,
    workers: int | None,
    plain_objects: int | None,
    cold: bool,
    growth: bool,
    sets: tuple[str, ...],
    set_frames: int,
    make_masks: bool,
    quick: bool,
    history: Path | None,
) -> None:
    """Time the made frame and FRAME_PATHS."""
    if quick:
        repeats, plain_objects = 1, 1 if plain_objects is None else plain_objects
    options = Options(repeats, workers or cores(), plain_objects, cold)
    frames = {MADE: four_objects()} if made else {}
    frames |= {str(path): read_frame(path) for path in frame_paths}
    if not frames and not sets:
        raise click.UsageError("name a frame or a set, or leave out --no-made")
    prior = open_prior(_starter() if prior_path is None else prior_path)
    machine = measure_machine()
    click.echo(
        f"{machine.processor}, {machine.cores} cores; one core: {machine.flops / 1e9:.0f} "
        f"GFLOP/s, {machine.bandwidth / 1e9:.1f} GB/s"
    )
    record: dict[str, Any] = {
        "time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "version": __version__,
        "machine": asdict(machine),
        "stored_objects": len(prior.names),
        "workers": options.workers,
        "frames": [measure(n, f, prior, machine, options) for n, f in frames.items()],
    }
    if sets:
        record["sets"] = measure_sets(sets, set_frames, make_masks, prior, options)
    if growth and frames:
        record["growth"] = measure_growth(next(iter(frames.values())), prior, options, quick)
    record["peak_megabytes"] = round(peak_megabytes(), 1)
    if history is not None:
        with history.open("a") as stream:
            stream.write(json.dumps(record) + "\n")


def measure(
    name: str, frame: Frame, prior: Prior, machine: Machine, options: Options
) -> dict[str, Any]:
    """Everything about one frame; prints it and returns it for JSON."""
    config, count = preset("default"), len(frame.object_ids)
    click.echo(f"\n{name}: {count} objects, {frame.shape[1]} x {frame.shape[0]}")
    alone = Reconstructor(prior, workers=1)
    many = Reconstructor(prior, workers=options.workers)
    alone(frame)
    many(frame)
    many.helpers.wait()
    helpers = many.helpers.processes
    runs = [run(lambda: alone(frame)) for _ in range(options.repeats)]
    stages = {
        stage: spread([_seconds(each.result, stage) for each in runs])
        for stage in ("observation", *STAGES)
    }
    many(frame)
    threaded = [run(lambda: many(frame), helpers) for _ in range(options.repeats)]
    memory = [own_megabytes(process) for process in helpers]
    many.close()
    wholes = {
        "1 thread": spread([each.wall for each in runs]),
        f"{options.workers} workers": spread([each.wall for each in threaded]),
        "CPU, 1 thread": spread([each.cpu for each in runs]),
        f"CPU, {options.workers}": spread([each.cpu for each in threaded]),
    }
    samples = observe(frame, config.observation, 0).objects
    mean = sum(len(o.samples) for o in samples.values()) // max(len(samples), 1)
    least = limits(machine, config, mean)
    plain, plain_cpu = _plain(frame, prior, options)

    click.echo(f"  {'':14}{'median':>9}{'least':>9}{'most':>9}{'plain':>9}{'ratio':>8}{'limit':>9}")
    for stage, found in {**stages, **wholes}.items():
        reference = plain_cpu if stage.startswith("CPU") else plain.get(stage, plain.get("whole"))
        limit = least[stage].seconds * count if stage in least else None
        click.echo(
            f"  {stage:14}{found.median:9.3f}{found.least:9.3f}{found.most:9.3f}"
            + (f"{reference:9.2f}{reference / found.median:8.1f}" if reference else f"{'':17}")
            + (f"{limit:9.3f}" if limit else "")
        )
    for stage, limit in least.items():
        click.echo(
            f"  limit of {stage}: {limit.operations / 1e9:.2f} G operations and "
            f"{limit.bytes / 1e6:.0f} MB an object"
        )
    if memory:
        told = ", ".join(f"{each:.0f}" for each in memory)
        click.echo(f"  MB that each helper process takes besides: {told}")
    with watch_denormals() as watched:
        alone(frame)
    denormals = by_folder(watched)
    told = ", ".join(f"{count} in {folder}" for folder, count in denormals.items())
    click.echo(f"  denormal numbers: {told or 'none'}")
    found: dict[str, Any] = {
        "name": name,
        "objects": count,
        "pixels": frame.segmap.size,
        "stages": {stage: value.as_dict() for stage, value in stages.items()},
        "whole": {key: value.as_dict() for key, value in wholes.items()},
        "limits": {stage: asdict(limit) for stage, limit in least.items()},
        "denormals": denormals,
        "helper_megabytes": memory,
    }
    if plain:
        found["plain"] = {**plain, "cpu": plain_cpu, "objects_timed": options.plain_objects}
    if options.cold:
        found["cold"] = [_cold(with_objects(frame, count), prior) for count in _counts(frame)]
    return found


def _counts(frame: Frame) -> list[int]:
    """One object, and all of them."""
    return sorted({1, len(frame.object_ids)})


def _seconds(result: Reconstruction, stage: str) -> float:
    return result.seconds.get(stage, 0.0) + sum(o.seconds.get(stage, 0.0) for o in result.objects)


def _plain(frame: Frame, prior: Prior, options: Options) -> tuple[dict[str, float], float | None]:
    """Seconds of each stage and of the whole frame, on all cores, and CPU seconds; what was timed
    for some of the objects is scaled to all of them."""
    if options.plain_objects == 0:
        return {}, None
    config = preset("paper")
    retriever = choose_retriever("auto", prior, config, 0)
    call = run(
        lambda: reconstruct_plainly(frame, prior, retriever, config, objects=options.plain_objects)
    )
    observation, spent = call.result
    share = len(frame.object_ids) / len(spent)
    seconds = {stage: sum(each[stage] for each in spent) * share for stage in STAGES}
    seconds["retrieval"] /= share
    seconds["observation"] = observation
    seconds["whole"] = sum(seconds.values())
    return seconds, call.cpu * share


def _cold(frame: Frame, prior: Prior) -> dict[str, float]:
    count = len(frame.object_ids)
    with tempfile.TemporaryDirectory() as folder:
        save_frame(frame, Path(folder) / "frame.npz")
        cold = cold_reconstruct(Path(folder) / "frame.npz", prior.path, Path(folder) / "result")
    click.echo(
        f"  cold `brrp reconstruct`, objects: {count}, {cold.cpu:.2f} s of CPU, {cold.wall:.2f} s, "
        f"{cold.megabytes:.0f} MB at most"
    )
    return {"objects": count, **asdict(cold)}


def measure_sets(
    sets: tuple[str, ...], most: int, make_masks: bool, prior: Prior, options: Options
) -> list[dict[str, Any]]:
    """A row for each NAME=FOLDER; prints them and returns them for JSON."""
    click.echo(f"\n{HEAD}")
    rows = []
    for name, _, folder in (each.partition("=") for each in sets):
        if not folder:
            raise click.UsageError(f"--set {name}: write NAME=FOLDER")
        found = measure_set(
            name,
            frames_of(Path(folder), most, masks=not make_masks),
            prior,
            options.workers,
            options.repeats,
            plain=options.plain_objects != 0,
        )
        click.echo(found.line())
        rows.append(asdict(found))
    return rows


def measure_growth(frame: Frame, prior: Prior, options: Options, quick: bool) -> list[dict]:
    """Seconds of one thread, stage by stage, with more and more of one thing."""
    click.echo(f"\n  {'growth with':16}{'':>10}" + "".join(f"{s:>13}" for s in STAGES))
    rows = []
    for what, size, changed, larger, config in cases(frame, prior, preset("default"), quick=quick):
        warm = Reconstructor(larger, config=config, workers=1)
        warm(changed)
        runs = [run(lambda w=warm, f=changed: w(f)) for _ in range(options.repeats)]
        seconds = {s: spread([_seconds(r.result, s) for r in runs]).median for s in STAGES}
        click.echo(f"  {what:16}{size:>10}" + "".join(f"{seconds[s]:13.3f}" for s in STAGES))
        rows.append({"what": what, "size": size, "seconds": seconds})
    return rows


def _starter() -> Path:
    from brrp_cli.prior.build.starter import starter_prior

    return starter_prior()


if __name__ == "__main__":
    main()
