"""`brrp eval SCENES/`: methods against known truth, rows, tables and plots."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from brrp_cli.commands.exit_codes import SOME_FAILED
from brrp_cli.commands.json_option import json_option, report_of
from brrp_cli.commands.method_options import (
    CONFIG_HELP,
    OneOf,
    check_weights,
    methods_help,
    weights_help,
)
from brrp_cli.commands.retriever_option import RetrieverName
from brrp_cli.commands.scheduler_option import scheduler_option
from brrp_cli.commands.seed_option import SEED, SEED_HELP, device_option
from brrp_cli.errors import SceneError
from brrp_cli.methods.registry import COMPARED, METHODS, preset_names
from brrp_cli.progress import note
from brrp_cli.retrieval.choose import RETRIEVERS
from brrp_cli.retrieval.clip.model_files import CLIP_DIR_VARIABLE
from brrp_cli.spoken import counted

ABLATIONS = ("truth",)


def _several(kind: click.ParamType) -> Callable[..., list[Any]]:
    """Option callback: values repeated or in one list with commas, in order, each once."""

    def read(ctx: click.Context, option: click.Parameter, values: tuple[str, ...]) -> list[Any]:
        parts = [part.strip() for value in values for part in value.split(",")]
        return list(dict.fromkeys(kind.convert(part, option, ctx) for part in parts))

    return read


def _selection(ctx: click.Context, option: click.Parameter, value: str | None) -> slice | None:
    if value is None:
        return None
    start, colon, stop = value.partition(":")
    try:
        if not colon:
            raise ValueError
        return slice(*(int(part) if part else None for part in (start, stop)))
    except ValueError:
        raise click.BadParameter(f"{value!r} is not A:B", ctx, option) from None


@click.command("eval")
@click.argument("scenes", type=click.Path(path_type=Path))
@click.option("--prior", "prior_path", type=click.Path(path_type=Path), help="The prior to use.")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="Folder to write. [default: SCENES_eval/]",
)
@click.option(
    "--data-root",
    type=click.Path(path_type=Path),
    help="Folder that the scenes' mesh paths are relative to. [default: found near SCENES]",
)
@click.option(
    "--method",
    "methods",
    multiple=True,
    default=[COMPARED],
    callback=_several(OneOf(lambda: list(METHODS))),
    help=f"{methods_help(list(METHODS))} [default: {COMPARED}]",
)
@click.option(
    "--weights",
    multiple=True,
    callback=_several(click.Path(path_type=Path)),
    help=f"{weights_help()} Tables show the names of the files.",
)
@click.option(
    "--preset",
    "presets",
    multiple=True,
    callback=_several(OneOf(preset_names)),
    help=f"Named configurations: {', '.join(preset_names())}. [default: each method's first]",
)
@click.option(
    "--config",
    "configs",
    multiple=True,
    callback=_several(click.Path(path_type=Path)),
    help=f"{CONFIG_HELP} Several are compared.",
)
@click.option(
    "--k",
    "ks",
    multiple=True,
    callback=_several(click.IntRange(min=1)),
    help="Numbers of retrieved objects, such as 1,3,5,10. [default: the presets' own]",
)
@click.option(
    "--retriever",
    "retrievers",
    multiple=True,
    default=["auto"],
    callback=_several(RetrieverName([*RETRIEVERS, *ABLATIONS])),
    help=f"Of {', '.join([*RETRIEVERS, *ABLATIONS])}, or a JSON or CSV file with probabilities. "
    "[default: auto]",
)
@click.option(
    "--clip-dir",
    type=click.Path(path_type=Path),
    help=f"Folder with CLIP ViT-B/16 as ONNX. [default: {CLIP_DIR_VARIABLE}, else the fetched]",
)
@click.option(
    "--shift-masks",
    "shifts",
    multiple=True,
    default=["0"],
    callback=_several(click.IntRange(-100, 100)),
    help="Shift masks to the right by so many pixels, such as 0,2. [default: 0]",
)
@click.option("--noise", is_flag=True, help="Add the noise of a structured-light camera.")
@click.option(
    "--scenes",
    "selection",
    metavar="A:B",
    callback=_selection,
    help="Only scenes A to B, without B.",
)
@click.option("--workers", type=click.IntRange(1), help="Processes of one thread. [default: cores]")
@scheduler_option
@click.option("--pictures", is_flag=True, help="Write a picture of each scene and variant.")
@click.option("--seed", type=SEED, default=0, show_default=True, help=SEED_HELP)
@device_option
@json_option
@click.option("--overwrite", is_flag=True, help="Start anew where another run's rows are.")
def command(
    scenes: Path,
    prior_path: Path | None,
    output: Path | None,
    data_root: Path | None,
    methods: list[str],
    weights: list[Path],
    presets: list[str],
    configs: list[Path],
    ks: list[int],
    retrievers: list[str],
    clip_dir: Path | None,
    shifts: list[int],
    noise: bool,
    selection: slice | None,
    workers: int | None,
    scheduler: str | None,
    pictures: bool,
    seed: int,
    device: str,
    as_json: bool,
    overwrite: bool,
) -> None:
    """Measure methods on scenes whose truth is known.

    SCENES holds scenes in the published layout, or NAME.npz with NAME.truth.json. Options that
    take several values take them repeated or with commas; all combinations are run. A run that was
    killed goes on where it was when the same command is given again.

    \b
    Example:
      brrp eval scenes/ --prior prior/ --data-root data/
      brrp eval scenes/ --method brrp --k 1,3,5,10 -o ablation/
      brrp eval scenes/ --preset paper,default --shift-masks 0,2 --scenes 0:20
      brrp eval scenes/ --method vprism,pointsdf --weights prior.safetensors,other.safetensors

    Exit codes: 0 all objects have a result, 3 some failed.
    """
    if not scenes.exists():  # told before what takes long to import
        raise SceneError("No such folder of scenes", where=scenes, fix="check the path")

    from brrp_cli.evaluation.request import Request, evaluate
    from brrp_cli.evaluation.summary import as_record

    check_weights(methods, weights)
    request = Request(
        scenes=scenes,
        output=output or scenes.parent / f"{scenes.resolve().name}_eval",
        data_root=data_root,
        methods=methods,
        presets=presets,
        configs=configs,
        ks=ks,
        retrievers=retrievers,
        shifts=shifts,
        prior=prior_path,
        weights=weights,
        clip_dir=clip_dir,
        noise=noise,
        selection=selection,
        seed=seed,
        device=device,
        workers=workers,
        scheduler=scheduler,
        pictures=pictures,
        overwrite=overwrite,
    )
    result = evaluate(request, say=note)
    with report_of(as_json) as report:
        for summary in result.summaries:
            distance, f_score = summary.figures["surface_distance"], summary.figures["f_score_5mm"]
            figures = f"distance {distance.value * 1000:.2f} mm  F(5 mm) {f_score.value:.3f}"
            iou = summary.figures["iou"]
            figures += f"  IoU as published {iou.value:.3f}"
            if not METHODS[summary.variant.method].gives_shapes:
                first, in_3 = summary.figures["true_first"], summary.figures["true_in_3"]
                figures = f"true object first {first.value:.3f}, among 3 {in_3.value:.3f}"
            click.echo(
                f"  {result.labels[summary.variant]:<24} {figures}"
                f"  {counted(summary.objects, 'object')}, {summary.failed} failed,"
                f" {summary.empty} empty"
            )
        click.echo(f"Wrote {request.output}/ ({', '.join(result.files)})")
        report["output"] = str(request.output)
        report["lost"] = result.lost
        report["results"] = {result.labels[s.variant]: as_record(s) for s in result.summaries}
    if result.lost or any(summary.failed for summary in result.summaries):
        sys.exit(SOME_FAILED)
