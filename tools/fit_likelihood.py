"""Fit the constants of the likelihood of placements on made scenes, or report with those in use.

    python tools/fit_likelihood.py --prior prior/ --data-root data/ -o fit.jsonl stereo/ xtion/
    python tools/fit_likelihood.py --prior prior/ --data-root data/ -o test.jsonl --report test/

Scenes of objects that the prior holds and of others, made with `tools/make_scenes.py --sensor`.
With `--segment` masks come from the frame alone, as users' do; what a mask shows is then the object
that most of its pixels belong to. Every mask is searched for as the default preset does. A
placement is right if it is of the true object and its surface lies within 5 mm of the true one on
average; where none is, "none of them" is right. What is minimised is the mean of -ln of the weight
of what is right, with a pull to the constants in use. Printed are values for LikelihoodConfig in
brrp_cli/config/registration.py, and what becomes of each set.

One line of OUTPUT for each mask; a second run goes on where the first was stopped, and may add
masks of another prior. P(c|R) of retrieval by appearance knows the depth, that of others may not.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from likelihood.masks import Mask, as_json, collect, read
from one_message import one_message

from brrp_cli.config import Config, LikelihoodConfig, preset
from brrp_cli.evaluation.calibration import expected_calibration_error
from brrp_cli.ground_truth.scenes import find_scenes
from brrp_cli.prior.store import open_prior
from brrp_cli.progress import progress
from brrp_cli.registration.weigh import weigh

FITTED = (
    "depth",
    "known_depth",
    "misfit",
    "missed",
    "covered",
    "free_space",
    "unmasked",
    "below",
    "colour",
    "base",
    "most_votes",
)
# Of ln of a constant, nats of `base`: how far the fit may go from the constants in use.
PULL = 1.0


@click.command()
@click.option("--prior", "prior_path", required=True, type=click.Path(path_type=Path))
@click.option("--data-root", type=click.Path(path_type=Path))
@click.option("--segment", "segmented", is_flag=True, help="Masks from the frame alone.")
@click.option("--report", is_flag=True, help="Fit nothing: report with the constants in use.")
@click.option("--only", default=",".join(FITTED), help="Constants to fit. [default: all]")
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path))
@click.argument("sets", nargs=-1, type=click.Path(path_type=Path))
@one_message()
def main(
    prior_path: Path,
    data_root: Path | None,
    segmented: bool,
    report: bool,
    only: str,
    output: Path,
    sets: tuple[Path, ...],
) -> None:
    """Collect from SETS, folders of scenes, into OUTPUT; fit on all that OUTPUT holds."""
    names = tuple(only.split(","))
    if set(names) - set(FITTED):
        raise click.UsageError(f"--only takes some of {','.join(FITTED)}")
    masks = read(output)
    prior = open_prior(prior_path)
    done = {(mask.group, mask.scene) for mask in masks}
    for folder in sets:
        group = f"{folder.name}, {prior_path.name}"
        group += ", masks from depth" if segmented else ""
        for scene in progress(find_scenes(folder), group):
            if (group, scene.name) in done:
                continue
            found = collect(scene, group, prior, data_root, segmented)
            with output.open("a") as stream:
                stream.writelines(json.dumps(as_json(mask)) + "\n" for mask in found)
            masks += found
    config = preset("default")
    assert config.hypotheses is not None
    if not report:
        fitted = fit(masks, config, names)
        for name in names:
            before = getattr(config.hypotheses.likelihood, name)
            click.echo(f"{name}: {getattr(fitted, name):.2f} (in use {before:.2f})")
        tell(masks, with_likelihood(config, fitted), "fitted")
    tell(masks, config, "in use")


def ratios(mask: Mask, config: LikelihoodConfig) -> NDArray[np.float64]:
    """Log likelihood ratios (C,), nats, of the placements of one mask."""
    depth = config.known_depth if mask.aligned else config.depth
    return np.array(
        [
            config.base
            + (
                depth * each.depth
                - config.missed * each.missed
                + config.covered * each.covered
                - config.free_space * each.free
                - config.unmasked * each.unmasked
            )
            / (1 + each.votes / config.most_votes)
            - config.misfit * each.misfit
            - config.below * each.below
            + config.colour * each.colour
            - config.other_size * each.resized
            for each in mask.placed
        ]
    )


def weights(mask: Mask, config: Config) -> NDArray[np.float64]:
    """(C + 1,) of the placements of one mask and, last, of none of them."""
    assert config.hypotheses is not None
    shares = [each.share for each in mask.placed]
    found = ratios(mask, config.hypotheses.likelihood)
    return weigh(shares, found.tolist(), mask.missing, config.hypotheses.weigh)


def loss(masks: list[Mask], config: Config) -> float:
    """Mean of -ln of the weight of what is right."""
    total = 0.0
    for mask in masks:
        right = np.array([*(each.right for each in mask.placed), False])
        right[-1] = not right.any()
        total -= np.log(max(float(weights(mask, config)[right].sum()), 1e-6))
    return total / len(masks)


def fit(masks: list[Mask], config: Config, names: Sequence[str] = FITTED) -> LikelihoodConfig:
    """The constants `names` of least loss, pulled to those in use, like the others."""
    from scipy.optimize import minimize

    assert config.hypotheses is not None
    start = config.hypotheses.likelihood

    def constants(x: NDArray[np.float64]) -> LikelihoodConfig:
        changed: dict[str, Any] = {
            name: float(getattr(start, name) + value)
            if name == "base"
            else float(getattr(start, name) * np.exp(value))
            for name, value in zip(names, x, strict=True)
        }
        return replace(start, **changed)

    def worth(x: NDArray[np.float64]) -> float:
        pulled = PULL * float((x**2).sum()) / len(masks)
        return loss(masks, with_likelihood(config, constants(x))) + pulled

    return constants(minimize(worth, np.zeros(len(names)), method="L-BFGS-B").x)


def with_likelihood(config: Config, likelihood: LikelihoodConfig) -> Config:
    """With other constants."""
    assert config.hypotheses is not None
    return replace(config, hypotheses=replace(config.hypotheses, likelihood=likelihood))


def tell(masks: list[Mask], config: Config, what: str) -> None:
    """What becomes of each set: loss, calibration error of the weight of the best placement, stored
    objects of 1,000 pixels or more that are recognised, and others that are taken for one."""
    click.echo(f"\n{what}:")
    for group in dict.fromkeys(mask.group for mask in masks):
        mine = [mask for mask in masks if mask.group == group]
        found = [weights(mask, config) for mask in mine]
        known = np.array([1 - each[-1] for each in found])
        right = np.array([any(each.right for each in mask.placed) for mask in mine])
        best = np.array([0 if len(each) == 1 else int(np.argmax(each[:-1])) for each in found])
        hit = np.array(
            [
                bool(mask.placed) and mask.placed[row].right
                for mask, row in zip(mine, best, strict=True)
            ]
        )
        large = np.array([mask.stored and mask.pixels >= 1000 for mask in mine])
        stranger = np.array([not mask.stored for mask in mine])
        taken = known > 0.5
        recognised = (taken & hit)[large].mean() if large.any() else np.nan
        click.echo(
            f"  {group}: {len(mine)} masks, loss {loss(mine, config):.3f}, "
            f"ECE {expected_calibration_error(known, right):.3f}; recognised "
            f"{recognised:.3f} of {large.sum()}; taken wrongly "
            f"{(taken & ~hit).mean():.3f} of all, "
            f"{taken[stranger].sum()} of {stranger.sum()} others"
        )


if __name__ == "__main__":
    main()
