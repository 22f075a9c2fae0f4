"""Train the completion that has learned shapes (brrp_cli/completion/shape_network.py).

    python tools/train_completion.py house:. drawn:. ycb_scenes:. stereo:.:measured -o train

SCENES:DATA_ROOT are scenes of `tools/make_scenes.py` without noise (docs/methods.md). Every view
becomes a frame of one of several depth cameras, or of none, some with masks that lie beside their
objects (training/completion_examples.py). The depth of SCENES:DATA_ROOT:measured is a camera's
already (`--sensor stereo`) and is taken as it is. First every object of every view becomes an
example, a volume and labelled points with their lengths, in OUTPUT/examples. Then the network is
trained, which begins as the network of lengths that comes with the package, or with `--begin`, as
an earlier network of shapes. The same command goes on where it was stopped or killed; more --epochs
lengthen a training that is over.

Some shapes, by name, are kept to validate. OUTPUT/shapes.safetensors has the weights of the epoch
with the least loss on them, with a temperature that was fitted to them; copied to
brrp_cli/completion/, it is what the package completes with. history.json has the losses of each
epoch, the last line of the output those of the network of lengths on the same points.
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

from brrp_cli.completion.learned import NAME, save_shapes
from brrp_cli.completion.network import fitted
from brrp_cli.errors import BrrpError
from brrp_cli.files import sha256_file
from brrp_cli.ground_truth.scenes import find_scenes

MEASURED = "measured"
SETS = f"SCENES:DATA_ROOT or SCENES:DATA_ROOT:{MEASURED}"


@click.command()
@click.argument("sets", nargs=-1)
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path))
@click.option("--views", default=2, show_default=True, type=click.IntRange(1))
@click.option("--epochs", default=6, show_default=True, type=click.IntRange(1))
@click.option(
    "--cooling", default=5, show_default=True, type=click.IntRange(0), help="Last epochs."
)
@click.option("--batch", default=8, show_default=True, type=click.IntRange(1), help="Objects.")
@click.option("--points", default=512, show_default=True, type=click.IntRange(1))
@click.option("--rate", default=2e-3, show_default=True, type=float, help="Of AdamW.")
@click.option(
    "--validation",
    default=0.08,
    show_default=True,
    type=click.FloatRange(0, 0.5),
    help="Share of the shapes.",
)
@click.option(
    "--begin",
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    help="As the network of this shapes.safetensors, in place of the network of lengths.",
)
@click.option("--seed", default=0, show_default=True)
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
    points: int,
    rate: float,
    validation: float,
    begin: Path | None,
    seed: int,
    minutes: float | None,
    examples_only: bool,
) -> None:
    """Train on SETS, SCENES:DATA_ROOT[:measured], or on the examples that are in OUTPUT already."""
    from training.completion import Training, TrainingConfig, resumed, scores, started
    from training.completion_examples import Wanted, held_names, make_all, names_in, read_examples

    from brrp_cli.completion.shape_network import ShapeNetworkConfig

    late = late_after(minutes)
    if cooling > epochs:
        raise BrrpError("--cooling is a part of --epochs", found=f"{cooling} of {epochs}")
    folder = output / "examples"
    wanted = []
    check_names(Path(each.partition(":")[0]) for each in sets)
    for each in sets:
        scenes, _, rest = each.partition(":")
        root, _, how = rest.partition(":")
        if how not in ("", MEASURED):
            raise BrrpError("A set is not understood", where=each, expected=SETS, found=how)
        wanted += [
            Wanted(scene, view, Path(root), how == MEASURED)
            for scene in find_scenes(Path(scenes))
            for view in range(views)
        ]
    for _ in tqdm(make_all(wanted, seed, folder), desc="examples", total=len(wanted)):
        pass
    paths = sorted(folder.glob("*/*.npz"))
    if not paths:
        raise BrrpError("There are no examples", where=folder, fix="name SETS to make them of")
    if examples_only:
        click.echo(f"Examples of {len(paths)} views: {folder}/")
        return
    kept = held_names(names_in(paths), validation, seed)
    train = read_examples(paths, lambda name: name not in kept)
    held = read_examples(paths, lambda name: name in kept)
    if not len(train) or not len(held):
        raise BrrpError(
            "There is too little to train on or to validate with",
            where=folder,
            found=f"{len(train)} and {len(held)} objects",
            fix="make more scenes",
        )
    config = TrainingConfig(
        epochs=epochs, cooling=cooling, batch=batch, rate=rate, seed=seed, points=points
    )
    network = started(ShapeNetworkConfig(), fitted(), seed) if begin is None else resumed(begin)
    training = Training(network, config, output, len(train))
    finished = run_watched(training, train, held, late)
    if not finished:
        return
    best = training.best(held)
    record = min(training.progress.history, key=lambda each: each["nll"])
    lengths = scores(fitted().logits(held.lengths.astype(np.float32)).astype(np.float64), held)
    about = {
        "objects": len(train),
        "shapes": len(Counter(train.names)),
        "validation_objects": len(held),
        "validation_shapes": len(Counter(held.names)),
        "points": len(train.inside),
        "temperature": float(best.temperature),
        "best": record,
        "lengths": lengths,
        "begun": None if begin is None else sha256_file(begin),
    }
    save_shapes(best, about, output / NAME)
    click.echo(f"Network of lengths: {lengths}; of shapes: {record}")
    click.echo(f"Wrote {output / NAME} ({(output / NAME).stat().st_size} bytes)")


if __name__ == "__main__":
    main()
