"""Train PointSDF on scenes of tools/make_scenes.py.

    python tools/make_scenes.py --meshes ycb --skip $UNSEEN --seed 5000 --scenes 2000 -o scenes_p
    python tools/train_pointsdf.py scenes_p --data-root . -o train/prior

and, with other shapes alone (the shapes of `scenes/other` are the first hundred random ones):

    python tools/export_random_shapes.py --first 100 --count 300 -o other_shapes
    python tools/export_drawn_shapes.py --count 150 --seed 5000 -o other_shapes
    python tools/make_scenes.py --meshes other_shapes --seed 5001 --scenes 2000 -o scenes_o
    python tools/train_pointsdf.py scenes_o --data-root . -o train/other

SCENES may be several folders.

First every object of every view becomes an example, a cloud and labelled query points, in
OUTPUT/examples/*.h5; scenes may be deleted after that. Then the network is trained. The same
command goes on where it was stopped or killed, with the same losses as if it had not been; more
--epochs lengthen a training that is over.

OUTPUT/NAME.safetensors, NAME being that of OUTPUT, has the weights of the epoch with the least loss
on the validation scenes, in half precision, for `brrp reconstruct --method pointsdf --weights`.
history.json has losses and IoU of each epoch.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import click
from tqdm import tqdm

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message
from training.examples import TRUTHS, Recipe, make_examples, read_examples
from training.scene_sets import check_names
from training.watched import late_after, run_watched

from brrp_cli.errors import BrrpError
from brrp_cli.evaluation.request import find_data_root
from brrp_cli.ground_truth.scenes import find_scenes
from brrp_cli.ground_truth.true_meshes import truth_cache


@click.command()
@click.argument("scenes", type=click.Path(path_type=Path), nargs=-1)
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path))
@click.option(
    "--data-root",
    type=click.Path(path_type=Path),
    help="Folder that the scenes' mesh paths are relative to. [default: found near SCENES]",
)
@click.option("--truth", default="closed", show_default=True, type=click.Choice(TRUTHS))
@click.option("--epochs", default=50, show_default=True, type=click.IntRange(1))
@click.option(
    "--cooling",
    default=0,
    show_default=True,
    type=click.IntRange(0),
    help="Last epochs, over which the rate falls to nothing.",
)
@click.option("--batch", default=16, show_default=True, type=click.IntRange(2), help="Objects.")
@click.option("--queries", default=512, show_default=True, type=click.IntRange(1))
@click.option("--noise", default=0.002, show_default=True, type=click.FloatRange(0), help="Metres.")
@click.option("--rate", default=1e-3, show_default=True, type=float, help="Of Adam.")
@click.option("--width", default=1.0, show_default=True, type=click.FloatRange(0.01, 4))
@click.option(
    "--precision",
    default="float32",
    show_default=True,
    type=click.Choice(["float32", "bfloat16"]),
)
@click.option("--validation", default=0.1, show_default=True, type=click.FloatRange(0, 0.5))
@click.option("--seed", default=0, show_default=True)
@click.option("--device", default="auto", type=click.Choice(["auto", "cpu", "cuda"]))
@click.option("--minutes", type=click.FloatRange(0), help="Stop, to go on later, after so long.")
@click.option("--every", default=200, show_default=True, type=click.IntRange(1), help="Steps.")
@click.option("--examples-only", is_flag=True, help="Make the examples and stop.")
@one_message()
def main(
    scenes: tuple[Path, ...],
    output: Path,
    data_root: Path | None,
    truth: str,
    epochs: int,
    cooling: int,
    batch: int,
    queries: int,
    noise: float,
    rate: float,
    width: float,
    precision: str,
    validation: float,
    seed: int,
    device: str,
    minutes: float | None,
    every: int,
    examples_only: bool,
) -> None:
    """Train on SCENES, one folder or several, or on the examples that are in OUTPUT already."""
    from training.pointsdf import Training, TrainingConfig, narrowed, split

    from brrp_cli.device import pick_device
    from brrp_cli.methods.pointsdf.network import NetworkConfig

    late = late_after(minutes)
    if cooling > epochs:
        raise BrrpError("--cooling is a part of --epochs", found=f"{cooling} of {epochs}")
    network = narrowed(NetworkConfig(), width)
    recipe = Recipe(truth, network.points, scale=network.scale)
    folder = output / "examples"
    check_names(scenes)
    for source in scenes:
        found = find_scenes(source)
        root = data_root or find_data_root(found, source)
        made = make_examples(found, root.absolute(), recipe, folder, truth_cache())
        for _ in tqdm(made, desc=source.name, total=len(found)):
            pass
    paths = sorted(folder.glob("*.h5"))
    if len(paths) < 2:
        raise BrrpError("Two scenes at least are needed", where=folder, found=len(paths))
    if examples_only:
        click.echo(f"Examples of {len(paths)} scenes: {folder}/")
        return
    names = split([path.name for path in paths], validation, seed)
    train, held = (read_examples([folder / n for n in group], recipe) for group in names)
    if len(train) < 2 or not len(held):
        raise BrrpError(
            "There is too little to train on or to validate with",
            where=folder,
            found=f"{len(train)} and {len(held)} objects",
            fix="make more scenes",
        )
    about = {
        "name": output.name,
        "scenes": len(paths),
        "validation_scenes": len(names[1]),
        "objects": len(train),
        "validation_objects": len(held),
        "truth": truth,
        "meshes": sorted(Counter(train.names)),
    }
    config = TrainingConfig(
        epochs=epochs,
        cooling=cooling,
        batch=batch,
        rate=rate,
        seed=seed,
        queries=queries,
        noise=noise,
        precision=precision,
    )
    weights = output / f"{output.name}.safetensors"
    training = Training(network, config, output, weights, about, pick_device(device))
    run_watched(training, train, held, late, every=every, line=_line)
    click.echo(f"Wrote {output}/ ({weights.name}, history.json, checkpoint.pt)")


def _line(record: dict[str, float]) -> str:
    return (
        f"epoch {record['epoch']}: loss {record['train_loss']:.4f}, validation "
        f"{record['validation_loss']:.4f}, IoU {record['validation_iou']:.3f}, "
        f"{record['seconds']:.0f} s"
    )


if __name__ == "__main__":
    main()
