"""`brrp demo`: the whole path on a made scene, scored against its truth."""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from brrp_cli.commands.exit_codes import SOME_FAILED
from brrp_cli.commands.json_option import json_option, report_of
from brrp_cli.commands.method_options import OneOf
from brrp_cli.commands.object_table import told
from brrp_cli.commands.seed_option import SEED, device_option
from brrp_cli.methods.registry import DEFAULT, METHODS
from brrp_cli.progress import note
from brrp_cli.spoken import NOT_STORED, counted

if TYPE_CHECKING:
    import trimesh

    from brrp_cli.demo.scene import DemoScene
    from brrp_cli.demo.score import Score
    from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction

FRAME = "frame.npz"


@click.command("demo")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    default=Path("brrp_demo"),
    show_default=True,
    help="Folder to write.",
)
@click.option(
    "--seed", type=SEED, default=0, show_default=True, help="Another seed, another scene."
)
@click.option(
    "--preset",
    "preset_name",
    type=OneOf(lambda: list(METHODS[DEFAULT].presets)),
    help="A named configuration of the method. [default: the first]",
)
@device_option
@json_option
@click.option("--overwrite", is_flag=True, help="Replace the output folder if it is there.")
def command(
    output: Path,
    seed: int,
    preset_name: str | None,
    device: str,
    as_json: bool,
    overwrite: bool,
) -> None:
    """Run the whole path on a made scene and score it.

    Builds the starter prior from household shapes on first use, makes a tabletop frame of some of
    them and of one in another size, with sensor noise and known truth, reconstructs the frame and
    compares each mesh with the truth. Needs no network and no data.

    \b
    Example:
      brrp demo
      brrp demo --seed 3 --preset paper -o demo3/
    """
    from brrp_cli.files import atomic_folder, check_writable, refuse_folder

    # Before what takes long to import.
    refuse_folder(output, overwrite=overwrite, mark=FRAME)
    check_writable(output.parent)

    from brrp_cli.api import reconstruct
    from brrp_cli.demo.scene import make_scene
    from brrp_cli.demo.score import score
    from brrp_cli.frames.npz import save_frame
    from brrp_cli.prior.build.starter import starter_prior
    from brrp_cli.prior.store import open_prior
    from brrp_cli.results.write import write_results
    from brrp_cli.retrieval.choose import choose_retriever

    start = time.perf_counter()
    prior = open_prior(starter_prior())
    note(f"Prior: {prior.path} (starter prior), {len(prior.names)} household shapes")
    scene = make_scene(seed)
    config = METHODS[DEFAULT].preset(preset_name)
    retriever = choose_retriever("auto", prior, config, seed)
    note(f"Scene: seed {seed}, {counted(len(scene.truth), 'object')}. Retrieval: {retriever.name}")
    result = reconstruct(
        scene.frame, prior, config=config, retriever=retriever, seed=seed, device=device
    )
    surfaces = {o.object_id: o.surface for o in result.objects}
    scores = {
        i: score(None if surface is None else surface.as_trimesh(), scene.truth[i], seed)
        for i, surface in surfaces.items()
    }
    with atomic_folder(output, overwrite=overwrite, mark=FRAME) as partial:
        save_frame(scene.frame, partial / FRAME)
        for object_id, mesh in scene.truth.items():
            save_truth(mesh, partial / "truth" / f"object_{object_id}.ply")
        write_results(result, partial / "result")
    with report_of(as_json) as record:
        report(result, scene, scores, set(prior.names))
        click.echo(
            f"Wrote {len(result.reconstructed)} of {counted(len(result.objects), 'object')},"
            f" metres, camera frame, in {time.perf_counter() - start:.0f} s: {output}/ (frame.npz,"
            " truth/object_*.ply, result/object_*.ply, result/scene.glb, result/preview.png)"
        )
        record["output"] = str(output)
        record["objects"] = [
            {
                **each.record(),
                "truth": scene.names[each.object_id],
                "in_prior": scene.names[each.object_id] in prior.names,
                "iou": scores[each.object_id].iou,
                "chamfer_m": scores[each.object_id].chamfer,
            }
            for each in told(result)
        ]
    if len(result.reconstructed) < len(result.objects):
        sys.exit(SOME_FAILED)


def save_truth(mesh: trimesh.Trimesh, path: Path) -> None:
    """Write a true mesh, metres, camera frame."""
    path.parent.mkdir(exist_ok=True)
    mesh.export(path)


def report(
    result: Reconstruction, scene: DemoScene, scores: dict[int, Score], stored: set[str]
) -> None:
    """Print a line for each object, and the means over those that have a value."""
    row = "  {:<4}{:<16}{:<10}{:<22}{:<22}{:>5}{:>10}{}".format
    click.echo(
        row("id", "truth", "in prior", "retrieved first", "most weight", "IoU", "Chamfer", "")
    )
    for item in result.objects:
        name, found = scene.names[item.object_id], scores[item.object_id]
        click.echo(
            row(
                item.object_id,
                name,
                "yes" if name in stored else "no",
                retrieved_first(item),
                most_weight(item),
                f"{found.iou:.2f}",
                centimetres(found.chamfer),
                "" if item.surface is not None else f"  {item.status}",
            )
        )
    distances = [s.chamfer for s in scores.values() if not math.isnan(s.chamfer)]
    mean_iou = sum(s.iou for s in scores.values()) / len(scores)
    mean_chamfer = sum(distances) / len(distances) if distances else math.nan
    click.echo(row("mean", "", "", "", "", f"{mean_iou:.2f}", centimetres(mean_chamfer), ""))


def retrieved_first(item: ObjectReconstruction) -> str:
    """What retrieval holds most probable, with its probability."""
    shares = [(r.probability, r.name) for r in item.retrieved]
    return largest([*shares, (item.unknown_probability, NOT_STORED)] if shares else [])


def most_weight(item: ObjectReconstruction) -> str:
    """What weighs most in the posterior, with its weight; a dash for a preset without weights."""
    shares = [(r.weight, r.name) for r in item.retrieved if r.weight is not None]
    return largest([*shares, (item.unknown_weight or 0.0, NOT_STORED)] if shares else [])


def largest(shares: list[tuple[float, str]]) -> str:
    """The name of the largest share and the share, or a dash."""
    return "{1} {0:.2f}".format(*max(shares)) if shares else "-"


def centimetres(metres: float) -> str:
    """Two decimals, or a dash where there is no value."""
    return "-" if math.isnan(metres) else f"{metres * 100:.2f} cm"
