"""`brrp reconstruct SOURCE`: a closed mesh of every object, and how sure that is."""

from __future__ import annotations

import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brrp_cli.commands.beside import POSES, Beside
from brrp_cli.commands.do_frame import in_a_stream, on_its_own
from brrp_cli.commands.exit_codes import SOME_FAILED
from brrp_cli.commands.export import CONFIDENCE, check_libraries
from brrp_cli.commands.grasp import GRIPPER_HELP
from brrp_cli.commands.json_option import json_option, report_of
from brrp_cli.commands.made_masks import MadeMasks, masks_asked, own_or_made_masks
from brrp_cli.commands.many_frames import Work, check_many, frame_slice, run_many
from brrp_cli.commands.method_options import (
    CONFIG_HELP,
    OneOf,
    check_options,
    check_weights,
    methods_help,
    weights_help,
)
from brrp_cli.commands.retriever_option import RetrieverName
from brrp_cli.commands.seed_option import SEED, SEED_HELP, device_option
from brrp_cli.commands.source_options import SourceOptions, source_options
from brrp_cli.commands.view import PAGE
from brrp_cli.commands.write_frame import WriteFrame
from brrp_cli.grasping.gripper_file import DEFAULT as DEFAULT_HAND
from brrp_cli.grasping.gripper_file import open_gripper
from brrp_cli.grasping.record import RECORD
from brrp_cli.methods.registry import DEFAULT, METHODS, preset_names, reconstructing
from brrp_cli.planning.options import PlanOptions
from brrp_cli.planning.parts import HOW
from brrp_cli.progress import note
from brrp_cli.retrieval.choose import RETRIEVERS, choose_retriever
from brrp_cli.retrieval.clip.model_files import CLIP_DIR_VARIABLE
from brrp_cli.spoken import counted

if TYPE_CHECKING:
    from brrp_cli.frames.frame import Frame
    from brrp_cli.grasping.gripper import Gripper
    from brrp_cli.methods.base import Method
    from brrp_cli.prior.store import Prior
    from brrp_cli.retrieval.base import Retriever

NO_COLLISION = "none"


@click.command("reconstruct")
@source_options
@click.option(
    "--frames",
    metavar="A:B",
    callback=frame_slice,
    help="Many frames of SOURCE: from A up to B, without B, counted from 0; `:` is all. Each goes"
    " into OUT/FRAME/; finished frames stay as they are.",
)
@click.option(
    "--track",
    is_flag=True,
    help="With --frames: they are one stream. Objects keep their ids, and objects at rest are not"
    " reconstructed again.",
)
@click.option("--prior", "prior_path", type=click.Path(path_type=Path), help="The prior to use.")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="Folder to write. [default: SOURCE_METHOD/]",
)
@click.option(
    "--method",
    type=OneOf(reconstructing),
    default=DEFAULT,
    show_default=True,
    help=methods_help(reconstructing()),
)
@click.option(
    "--weights",
    type=click.Path(path_type=Path),
    help=weights_help(),
)
@click.option(
    "--preset",
    "preset_name",
    type=OneOf(preset_names),
    help="A named configuration of the method. [default: its first]",
)
@click.option("--config", "file", type=click.Path(path_type=Path), help=CONFIG_HELP)
@click.option(
    "--k",
    type=click.IntRange(min=1),
    help="Number of retrieved objects that are tried. [default: the preset's]",
)
@click.option(
    "--retriever",
    type=RetrieverName(RETRIEVERS),
    default="auto",
    show_default=True,
    help=f"{', '.join(RETRIEVERS)}, or a JSON or CSV file with probabilities.",
)
@click.option(
    "--clip-dir",
    type=click.Path(path_type=Path),
    help=f"Folder with CLIP ViT-B/16 as ONNX. [default: {CLIP_DIR_VARIABLE}, else the fetched]",
)
@click.option(
    "--frame",
    "coordinates",
    type=click.Choice(["camera", "world"]),
    default="camera",
    show_default=True,
    help="Coordinates of the meshes; world needs the camera's pose (--camera-pose).",
)
@click.option("--seed", type=SEED, default=0, show_default=True, help=SEED_HELP)
@device_option
@click.option("--workers", type=click.IntRange(1), help="Objects done at a time. [default: cores]")
@click.option(
    "--collision",
    type=click.Choice([*HOW, NO_COLLISION]),
    default=NO_COLLISION,
    show_default=True,
    help="Also write what `brrp export` writes, into OUT/plan/.",
)
@click.option(
    "--confidence",
    type=CONFIDENCE,
    help="With --collision: shapes inside which each object lies with this probability.",
)
@click.option(
    "--grasp", "grasp_it", is_flag=True, help=f"Also plan grasps (`brrp grasp`): OUT/{RECORD}."
)
@click.option(
    "--gripper",
    metavar="NAME|FILE.yaml",
    help=f"With --grasp: {GRIPPER_HELP} [default: {DEFAULT_HAND}]",
)
@click.option(
    "--poses",
    type=click.Choice(["bop"]),
    help=f"Also write the 6D poses of recognised objects: OUT/{POSES}, a BOP results file.",
)
@click.option("--html", is_flag=True, help=f"Also write the page of `brrp view`: OUT/{PAGE}.")
@click.option(
    "--view", "open_it", is_flag=True, help="Write the page of --html and open it in a browser."
)
@json_option
@click.option("--overwrite", is_flag=True, help="Replace the output folder if it is there.")
def command(
    source: SourceOptions,
    frames: slice | None,
    track: bool,
    prior_path: Path | None,
    output: Path | None,
    method: str,
    weights: Path | None,
    preset_name: str | None,
    file: Path | None,
    k: int | None,
    retriever: str,
    clip_dir: Path | None,
    coordinates: str,
    seed: int,
    device: str,
    workers: int | None,
    collision: str,
    confidence: float | None,
    grasp_it: bool,
    gripper: str | None,
    poses: str | None,
    html: bool,
    open_it: bool,
    as_json: bool,
    overwrite: bool,
) -> None:
    """Turn an RGBD frame into a closed mesh for every object.

    SOURCE is a frame file or anything else that `brrp frame` reads; or name the images of one
    frame. Where there are no masks they are made: by --prompt, else from depth. A picture of
    them is written beside the output; `brrp segment OUT/frame.npz` corrects them.

    The prior is --prior, else BRRP_PRIOR, else the one in the user's data folder, else the
    starter prior, for a --method that needs one. Meshes are in metres, in the camera frame unless
    --frame world is given.

    \b
    Example:
      brrp reconstruct frame.npz
      brrp reconstruct --color c.png --depth d.png --intrinsics k.json --view
      brrp reconstruct frame.npz --prior prior/ --preset paper -o out/ --seed 1
      brrp reconstruct frame.npz --method vprism
      brrp reconstruct frame.npz --method pointsdf
      brrp reconstruct frame.npz --collision coacd --confidence 0.95
      brrp reconstruct frame.npz --grasp --gripper robotiq-2f-85
      brrp reconstruct frame.npz --prior prior/ --poses bop
      brrp reconstruct recording.bag --frames 0:300:30 --prior prior/ -o out/
      brrp reconstruct recording.bag --frames : --track --prior prior/ -o out/
    """
    source.check()
    check_weights([method], [] if weights is None else [weights])

    from brrp_cli.config.segmentation import SegmentConfig
    from brrp_cli.methods.config_file import read_config
    from brrp_cli.methods.configuration import as_record
    from brrp_cli.methods.shared_work import started_later
    from brrp_cli.results.write import check_output

    check_collision(collision, confidence)
    hand = check_gripper(grasp_it, gripper)
    chosen = METHODS[method]
    check_options(chosen, preset_name, device)
    own = None if file is None else read_config(file)
    config = chosen.preset(preset_name) if own is None else own.config(chosen, preset_name)
    config = replace(config, k=k) if k else config
    output = output or source.name.with_name(f"{source.name.name}_{method}")
    # What can be refused is refused before the work, not after it.
    if track and frames is None:
        raise click.UsageError("--track is of many frames: add --frames")
    if frames is not None:
        check_many(source, output, open_it=open_it)
    else:
        read = source.read()
        check_output(output, read, coordinates, overwrite=overwrite)
    mask_config = SegmentConfig() if own is None else own.segmentation()

    def with_masks(frame: Frame, folder: Path) -> tuple[Frame, MadeMasks | None]:
        if track:  # the stream makes masks, and mends those that brrp made before
            return (frame.without_masks() if source.prompt else frame), None
        again = overwrite or frames is not None
        return own_or_made_masks(source, frame, folder, seed, mask_config, overwrite=again)

    if frames is None:
        seen, masks = with_masks(read, output)
    prior, retrieval = open_prior_of(chosen, prior_path, config, retriever, clip_dir, seed)
    note_method(chosen, prior, k, weights)
    given: dict[str, Any] = {
        "prior": prior,
        "method": method,
        "config": config,
        "retriever": retrieval,
        "weights": weights,
        "seed": seed,
        "device": device,
        "workers": workers,
    }
    if track:
        do = in_a_stream(given, source, mask_config)
    else:
        # Who asks for one frame has no use for them.
        do = on_its_own(given, started_later(chosen, workers, 0 if frames is None else None))
    beside = Beside(
        poses=poses is not None,
        names=[] if prior is None else prior.names,
        plan=None if collision == NO_COLLISION else PlanOptions(collision, confidence, seed=seed),
        hand=hand,
        page=html or open_it,
        open_it=open_it,
        seed=seed,
    )

    # A stream is followed from its first frame, whatever of it was there.
    one = WriteFrame(do, source, coordinates, overwrite or track, beside)
    with report_of(as_json) as report:
        report["output"] = str(output)
        report["frame"] = coordinates
        if frames is not None:
            settings = {
                "method": method,
                "seed": seed,
                "frame": coordinates,
                "retriever": None if retrieval is None else retrieval.name,
                "prior": None if prior is None else prior.digest,
                "config": as_record(config),
                "segmentation": asdict(mask_config),
                "masks": masks_asked(source),
            }
            work = Work(source, with_masks, one, beside, settings, overwrite, track)
            failed = run_many(work, frames, output, report)
        else:
            table = one(read, seen, masks, output, overwrite)
            report["objects"] = [each.record() for each in table]
            failed = any(each.failed for each in table)
    if failed:
        sys.exit(SOME_FAILED)


def check_collision(collision: str, confidence: float | None) -> None:
    """UsageError for --confidence alone; DependencyError where a library is missing."""
    if collision == NO_COLLISION and confidence is not None:
        raise click.UsageError(f"--confidence is of collision shapes: add --collision {HOW[0]}")
    if collision != NO_COLLISION:
        check_libraries(PlanOptions(collision, confidence))


def check_gripper(grasp_it: bool, gripper: str | None) -> Gripper | None:
    """The gripper of --grasp; UsageError for --gripper alone, GripperError for one that is not
    known."""
    if gripper is not None and not grasp_it:
        raise click.UsageError("--gripper is of grasps: add --grasp")
    return open_gripper(gripper or DEFAULT_HAND) if grasp_it else None


def note_method(method: Method, prior: Prior | None, k: int | None, weights: Path | None) -> None:
    """Say what is tried where --k asks for more, and what a method without a prior uses."""
    if prior is not None and k is not None and k > len(prior.names):
        note(f"--k {k}: all of the prior's {counted(len(prior.names), 'object')} are taken")
    if prior is None:
        came = method.own_weights
        used = weights or (came and f"{came.stem} (what comes with brrp)")
        note(f"Method: {method.name}, without a prior" + (f", weights {used}" if used else ""))


def open_prior_of(
    method: Method,
    prior_path: Path | None,
    config: Any,
    retriever: str,
    clip_dir: Path | None,
    seed: int,
) -> tuple[Prior | None, Retriever | None]:
    """The prior and the retriever of its objects, where the method uses them; says which they
    are."""
    if not method.uses_prior:
        return None, None
    from brrp_cli.prior.default import locate_prior
    from brrp_cli.prior.store import open_prior

    located, how = locate_prior(prior_path)
    prior = open_prior(located)
    note(f"Prior: {located} ({how}), {counted(len(prior.names), 'object')}")
    if not method.uses_retriever:
        return prior, None
    chosen = choose_retriever(retriever, prior, config, seed, clip_dir=clip_dir)
    note(f"Retrieval: {chosen.name}")
    return prior, chosen
