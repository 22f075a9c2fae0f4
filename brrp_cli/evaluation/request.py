"""`brrp eval` from request to report."""

from __future__ import annotations

import json
import os
import platform
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from brrp_cli.evaluation.bootstrap import ROUNDS
from brrp_cli.evaluation.folder import PARAMETERS, ROWS, claimed
from brrp_cli.evaluation.match_names import match_names
from brrp_cli.evaluation.report import write_report
from brrp_cli.evaluation.rows import METRICS, Row, RowLog, table
from brrp_cli.evaluation.run import collect, remaining, run_remaining
from brrp_cli.evaluation.summary import (
    VariantSummary,
    as_record,
    differences,
    interval_record,
    summarise,
)
from brrp_cli.evaluation.variants import Variant, expand, same_results, short_labels
from brrp_cli.evaluation.weights import described_weights, named_weights, weights_digests
from brrp_cli.evaluation.work import Plan
from brrp_cli.executors.executor import Executor, open_executor
from brrp_cli.files import sha256_file, write_bytes
from brrp_cli.ground_truth.scenes import Scene, find_scenes
from brrp_cli.ground_truth.true_meshes import truth_cache
from brrp_cli.methods.config_file import read_config
from brrp_cli.methods.registry import METHODS
from brrp_cli.prior.store import Prior
from brrp_cli.progress import progress
from brrp_cli.retrieval.choose import USE_CLIP, resolve_name
from brrp_cli.retrieval.clip.model_files import clip_folder, need_clip_folder
from brrp_cli.spoken import counted
from brrp_cli.stop import stopped
from brrp_cli.version import __version__


@dataclass(frozen=True)
class Request:
    """What the user asked for; see `brrp eval --help`."""

    scenes: Path
    output: Path
    methods: list[str]
    presets: list[str]
    ks: list[int]
    retrievers: list[str]
    shifts: list[int]
    data_root: Path | None = None
    prior: Path | None = None
    weights: list[Path] = field(default_factory=list)
    configs: list[Path] = field(default_factory=list)
    clip_dir: Path | None = None
    noise: bool = False
    selection: slice | None = None
    seed: int = 0
    device: str = "auto"
    workers: int | None = None
    scheduler: str | None = None
    pictures: bool = False
    overwrite: bool = False


@dataclass(frozen=True)
class Result:
    """lost : scene -> why it has no rows; files : what was written, below the output folder."""

    summaries: list[VariantSummary]
    labels: dict[Variant, str]
    lost: dict[str, str]
    files: list[str]


def evaluate(request: Request, say: Callable[[str], None] = lambda text: None) -> Result:
    """Run what was not run yet and write the report.

    Errors: SceneError, PriorError, RetrievalError, WeightsError or MeshError before the work
    starts; OutputError if the folder holds a different run and `overwrite` is false; StoppedError
    after Ctrl-C or SIGTERM; ClusterError where the scheduler does not answer or is lost.
    """
    scenes = find_scenes(request.scenes, request.selection)
    opened = _prior(request)
    prior = None if opened is None else {"path": str(opened.path), "digest": opened.digest}
    weights = named_weights(request.methods, request.weights)
    training = described_weights(request.methods, weights)
    variants = _variants(request, list(weights))
    _check_prior(opened, variants)
    if any(variant.retriever in USE_CLIP for variant in variants):
        _prepare_clip(opened, need_clip_folder(request.clip_dir))
    parameters = _parameters(request, scenes, variants, prior, weights)
    data_root = request.data_root or find_data_root(scenes, request.scenes)
    if opened is not None:
        scenes, matched = match_names(scenes, data_root, opened.manifest.objects)
        _say_what_is_odd(opened, matched > 0, variants, say)
    labels = short_labels(variants)
    plan = Plan(
        scenes=scenes,
        variants=variants,
        data_root=data_root,
        cache=truth_cache(),
        prior=None if prior is None else Path(prior["path"]),
        clip_dir=request.clip_dir,
        noise=request.noise,
        seed=request.seed,
        device=request.device,
        pictures=request.output / "pictures" if request.pictures else None,
        weights=weights if request.weights else {},
    )
    with (
        open_executor(request.workers, request.scheduler) as executor,
        claimed(request.output, parameters, overwrite=request.overwrite) as path,
    ):
        say(f"{counted(len(scenes), 'scene')}, {executor.title}: {', '.join(labels.values())}")
        log = RowLog(path)
        lost = _run(plan, log, executor, request.output, say)
        rows = collect(plan, log, lost)
        about = {
            **parameters,
            "prior": prior,
            "trained": training,
            "command": shlex.join(["brrp", *sys.argv[1:]]),
            "machine": machine(),
            "bootstrap_rounds": ROUNDS,
            "same": {
                labels[v]: labels[first]
                for v, first in same_results(variants).items()
                if v != first
            },
            "lost": lost,
        }
        summaries, files = _write(request.output, rows, variants, labels, about, request.seed)
    return Result(summaries, labels, lost, files)


def _variants(request: Request, weights: Sequence[str]) -> list[Variant]:
    """What is compared, as the options ask for it; weights : names."""
    return expand(
        request.methods,
        request.presets,
        request.ks,
        [resolve_name(name, request.clip_dir) for name in request.retrievers],
        request.shifts,
        weights,
        [read_config(path) for path in request.configs],
    )


def _say_what_is_odd(
    prior: Prior, matched: bool, variants: Sequence[Variant], say: Callable[[str], None]
) -> None:
    """matched : whether any true object is in the prior"""
    if not matched:
        say(
            f"None of the true objects is in the prior {prior.path}, by content or by name:"
            " what the tables say of retrieval and recognition is of strangers alone"
        )
    for variant in variants:
        if variant.k is not None and variant.k > len(prior.names):
            held = counted(len(prior.names), "object")
            say(f"--k {variant.k}: the prior holds {held}, all are taken")


def _run(
    plan: Plan, log: RowLog, executor: Executor, output: Path, say: Callable[[str], None]
) -> dict[str, str]:
    """What is not in the log yet; scene -> why it has no rows. Errors: StoppedError."""
    lost: dict[str, str] = {}
    todo = remaining(plan, log)
    work = run_remaining(plan, log, todo, executor)
    try:
        for ended, error in progress(work, "true meshes, then scenes", len(todo)):
            if error is not None and isinstance(ended, Scene):
                lost[ended.name] = str(error)
            if error is not None:
                say(f"{ended.name}: {error}")
    except KeyboardInterrupt as stop:
        raise stopped(
            stop,
            where=output,
            found="scenes and variants that were finished are kept",
            fix="give the same command again to go on",
        ) from None
    finally:
        work.close()
    return lost


def find_data_root(scenes: Sequence[Scene], folder: Path) -> Path:
    """The folder beside or above the scenes below which their first mesh lies; `folder` if there
    is none, which reading the mesh will tell."""
    first = next((o.mesh_path for scene in scenes for o in scene.objects), "")
    folder = folder.resolve()
    near = (folder, folder / "data", folder.parent / "data", folder.parent, folder.parent.parent)
    for candidate in near:
        if (candidate / first).is_file():
            return candidate
    return folder


def machine() -> str:
    """What the times were measured on."""
    import torch

    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = info.read_text().splitlines()
        model = next(
            (x.split(":", 1)[1].strip() for x in lines if x.startswith("model name")), model
        )
    return (
        f"{model}, {os.cpu_count()} processors; {platform.system()}, Python "
        f"{platform.python_version()}, torch {torch.__version__}"
    )


def _prior(request: Request) -> Prior | None:
    """The prior, where a method needs one. Errors: PriorError."""
    from brrp_cli.prior.default import locate_prior
    from brrp_cli.prior.store import open_prior

    if not any(METHODS[name].uses_prior for name in request.methods):
        return None
    path, _ = locate_prior(request.prior)
    return open_prior(path)


def _check_prior(prior: Prior | None, variants: Sequence[Variant]) -> None:
    """What a variant lacks in the prior is told now, not in every row. Errors: PriorError."""
    if prior is None:
        return
    for variant in variants:
        check_prior = METHODS[variant.method].check_prior
        if check_prior is not None:
            check_prior(prior, variant.config)


def _prepare_clip(prior: Prior | None, folder: Path) -> None:
    """Embed the descriptions once, so that no worker has to; a missing model is told now, not in
    every row."""
    from brrp_cli.retrieval.clip.retriever import keep_descriptions

    assert prior is not None
    keep_descriptions(prior, folder)


def _parameters(
    request: Request,
    scenes: Sequence[Scene],
    variants: Sequence[Variant],
    prior: dict[str, str] | None,
    weights: Mapping[str, Path],
) -> dict[str, Any]:
    """What decides the rows."""
    clip = clip_folder(request.clip_dir)
    uses_clip = any(variant.retriever in USE_CLIP for variant in variants)
    files = {v.retriever for v in variants if v.retriever and Path(v.retriever).is_file()}
    return {
        "brrp": __version__,
        "scenes": str(request.scenes.resolve()),
        "scenes_total": len(scenes),
        "scenes_first": scenes[0].name,
        "scenes_last": scenes[-1].name,
        "prior_digest": None if prior is None else prior["digest"],
        "clip": str(clip) if uses_clip else None,
        "tables": {file: sha256_file(Path(file)) for file in sorted(files)},
        **weights_digests(weights),
        "noise": request.noise,
        "seed": request.seed,
        "variants": {variant.label: variant.configuration for variant in variants},
    }


def _write(
    folder: Path,
    rows: list[Row],
    variants: list[Variant],
    labels: dict[Variant, str],
    about: dict[str, Any],
    seed: int,
) -> tuple[list[VariantSummary], list[str]]:
    """metrics.csv, summary.json, plots and report.md."""
    from brrp_cli.evaluation.plots import write_plots

    summaries = summarise(rows, variants, seed)
    found = differences(rows, variants, seed, METRICS)
    summary = {
        **about,
        "results": {labels[s.variant]: as_record(s) for s in summaries},
        "differences": {
            f"{labels[a]} - {labels[b]}": {name: interval_record(i) for name, i in d.items()}
            for (a, b), d in found.items()
        },
    }
    plots = write_plots(folder / "plots", summaries, labels)
    write_bytes(folder / "metrics.csv", table(rows).encode())
    write_bytes(folder / "summary.json", (json.dumps(summary, indent=1) + "\n").encode())
    report = write_report(about, summaries, found, labels, plots)
    write_bytes(folder / "report.md", report.encode())
    pictures = ["pictures/"] if (folder / "pictures").is_dir() else []
    return summaries, [
        "report.md",
        "metrics.csv",
        "summary.json",
        "plots/",
        *pictures,
        ROWS,
        PARAMETERS,
    ]
