"""Train the network that parts objects from depth and colour (brrp_cli/segmentation).

    python tools/train_masks.py house ycb_stereo:measured ycb_xtion:measured -o train

SCENES are scenes of `tools/make_scenes.py` without noise (docs/frames-and-masks.md): every view
becomes a frame of one of several depth cameras, or of none. The depth of SCENES:measured is a
camera's already (`--sensor stereo`) and is taken as it is. First every view becomes an example,
colour and geometry with true labels, in OUTPUT/examples. Then the network is trained, from the
start or, with `--begin`, from the weights of an earlier training. The same command goes on where
it was stopped or killed; more --epochs lengthen a training that is over.

Some scenes are kept to validate. OUTPUT/affinities.onnx has the weights of the epoch with
the least loss on them; in brrp_cli/segmentation/, as affinities.onnx or affinities_walled.onnx,
it is what the package parts objects with. history.json has the losses of each epoch.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import click
import numpy as np
from tqdm import tqdm

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message
from training.scene_sets import check_names
from training.watched import late_after, run_watched

from brrp_cli.errors import BrrpError
from brrp_cli.files import sha256_file
from brrp_cli.ground_truth.scenes import find_scenes
from brrp_cli.segmentation.learned_affinities import NAME

MEASURED = "measured"
SETS = f"SCENES or SCENES:{MEASURED}"


@click.command()
@click.argument("sets", nargs=-1)
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path))
@click.option("--views", default=2, show_default=True, type=click.IntRange(1))
@click.option("--epochs", default=10, show_default=True, type=click.IntRange(1))
@click.option(
    "--cooling", default=9, show_default=True, type=click.IntRange(0), help="Last epochs."
)
@click.option("--batch", default=8, show_default=True, type=click.IntRange(1), help="Views.")
@click.option("--rate", default=3e-3, show_default=True, type=float, help="Of AdamW.")
@click.option(
    "--precision",
    default="float32",
    show_default=True,
    type=click.Choice(["float32", "bfloat16"]),
)
@click.option(
    "--validation",
    default=0.04,
    show_default=True,
    type=click.FloatRange(0, 0.5),
    help="Share of the scenes.",
)
@click.option(
    "--begin",
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    help="As the network of this affinities.onnx.",
)
@click.option("--seed", default=0, show_default=True)
@click.option("--workers", default=2, show_default=True, type=click.IntRange(1))
@click.option("--minutes", type=click.FloatRange(0), help="Stop, to go on later, after so long.")
@click.option("--examples-only", is_flag=True, help="Make the examples and stop.")
@one_message()
def main(
    sets: tuple[str, ...],
    output: Path,
    views: int,
    epochs: int,
    cooling: int,
    batch: int,
    rate: float,
    precision: str,
    validation: float,
    begin: Path | None,
    seed: int,
    workers: int,
    minutes: float | None,
    examples_only: bool,
) -> None:
    """Train on SETS, SCENES or SCENES:measured, or on the examples that are in OUTPUT already."""
    from training.affinity_file import save_affinity_network
    from training.affinity_network import AffinityNetworkConfig
    from training.mask_examples import Wanted, is_held, make_all, read_examples
    from training.masks import Training, TrainingConfig, resumed, started

    late = late_after(minutes)
    if cooling > epochs:
        raise BrrpError("--cooling is a part of --epochs", found=f"{cooling} of {epochs}")
    folder = output / "examples"
    wanted = []
    check_names(Path(each.partition(":")[0]) for each in sets)
    for each in sets:
        scenes, _, how = each.partition(":")
        if how not in ("", MEASURED):
            raise BrrpError("A set is not understood", where=each, expected=SETS, found=how)
        wanted += [
            Wanted(scene, view, how == MEASURED)
            for scene in find_scenes(Path(scenes))
            for view in range(views)
        ]
    made = make_all(wanted, seed, folder, workers)
    for _ in tqdm(made, desc="examples", total=len(wanted)):
        pass
    paths = sorted(folder.glob("*/*.npz"))
    if examples_only:
        click.echo(f"Examples of {len(paths)} views: {folder}/")
        return
    train = read_examples([path for path in paths if not is_held(path, validation, seed)])
    held = read_examples([path for path in paths if is_held(path, validation, seed)])
    if not len(train) or not len(held):
        raise BrrpError(
            "There is too little to train on or to validate with",
            where=folder,
            found=f"{len(train)} and {len(held)} views",
            fix="name SETS to make examples of, or more of them",
        )
    config = TrainingConfig(
        epochs=epochs,
        cooling=cooling,
        batch=batch,
        rate=rate,
        seed=seed,
        precision=precision,
    )
    network = started(AffinityNetworkConfig(), seed) if begin is None else resumed(begin, seed)
    training = Training(network, config, output, len(train))
    finished = run_watched(training, train, held, late)
    if not finished:
        return
    record = min(training.progress.history, key=lambda each: each["held_loss"])
    about = {
        "views": len(train),
        "sets": Counter(name.partition("/")[0] for name in train.names),
        "validation_views": len(held),
        "objects": int(sum(len(np.unique(each)) - 1 for each in train.labels)),
        "best": record,
        "begun": None if begin is None else sha256_file(begin),
    }
    save_affinity_network(training.best(), about, output / NAME)
    click.echo(f"Network: {record}")
    click.echo(f"Wrote {output / NAME} ({(output / NAME).stat().st_size} bytes)")


if __name__ == "__main__":
    main()
