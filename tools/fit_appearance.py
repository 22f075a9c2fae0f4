"""Fit the constants of retrieval by appearance on made scenes, or report with those in the code.

    python tools/fit_appearance.py --prior prior/ fit_prior/ fit_unseen/ fit_other/
    python tools/fit_appearance.py --prior prior/ --report test_prior/ test_unseen/ test_other/

Scenes of objects that the prior holds and of others, made with `tools/make_scenes.py --noise
structured-light --light varied`; every view counts. What is minimised is the mean of -ln P(what it
is | R), where what is not in the prior is one more class. Printed are the values for
FusionConfig in brrp_cli/config/retrieval.py, and what becomes of each set.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from brrp_cli.config import preset
from brrp_cli.config.retrieval import FusionConfig, IlluminantsConfig
from brrp_cli.errors import BrrpError
from brrp_cli.evaluation.calibration import expected_calibration_error
from brrp_cli.ground_truth.scenes import find_scenes
from brrp_cli.prior.store import Prior, open_prior
from brrp_cli.progress import progress
from brrp_cli.retrieval.appearance import AppearanceRetriever
from brrp_cli.retrieval.base import unknown
from brrp_cli.retrieval.illuminants import lights, local_lights, log_prior
from brrp_cli.retrieval.score_fusion import Similarity, believe

LARGE = 500  # visible pixels


@dataclass(frozen=True)
class View:
    """What one view shows: evidence, visible pixels and the true row (-1: not in the prior)."""

    group: str
    evidence: list[Similarity]
    pixels: list[int]
    truth: list[int]


@click.command()
@click.option("--prior", "prior_path", required=True, type=click.Path(path_type=Path))
@click.option("--report", is_flag=True, help="Fit nothing: report with the constants in the code.")
@click.argument("sets", nargs=-1, required=True, type=click.Path(path_type=Path))
def main(prior_path: Path, report: bool, sets: tuple[Path, ...]) -> None:
    """Fit on SETS, folders of scenes, and print constants and hit rates."""
    try:
        prior = open_prior(prior_path)
        views = [view for folder in sets for view in look(prior, folder)]
    except BrrpError as error:
        raise click.ClickException(str(error)) from error
    count = len(prior.names)
    weights = FusionConfig() if report else fit(views, count)
    click.echo(f"{weights}, mean loss {loss(views, weights, count):.4f}")
    click.echo(f"calibration error over all of them {calibration(views, weights, count):.3f}")
    for folder in sets:
        members = [view for view in views if view.group == folder.name]
        for large in (True, False):
            click.echo(line(folder.name, members, weights, count, large))


def look(prior: Prior, folder: Path) -> list[View]:
    """The evidence of all views of all scenes in a folder."""
    retriever = AppearanceRetriever(prior, preset("default"), 0)
    views = []
    for scene in progress(find_scenes(folder), folder.name):
        for index in range(len(scene.views)):
            frame = scene.view(index)
            found = retriever.evidence(frame)
            names = [scene.object(i).name for i in found]
            views.append(
                View(
                    group=folder.name,
                    evidence=list(found.values()),
                    pixels=[int(np.count_nonzero(frame.segmap == i)) for i in found],
                    truth=[prior.names.index(n) if n in prior.names else -1 for n in names],
                )
            )
    return views


def fit(views: Sequence[View], count: int) -> FusionConfig:
    """The weights with the least loss. All of them are positive."""
    from scipy.optimize import minimize

    found = minimize(
        lambda x: loss(views, FusionConfig(*np.exp(x)), count),
        np.log(astuple(FusionConfig())),
        method="Nelder-Mead",
        options={"xatol": 1e-2, "fatol": 1e-4, "maxfev": 150},
    )
    return FusionConfig(*(round(float(value), 2) for value in np.exp(found.x)))


def answers(
    views: Sequence[View], weights: FusionConfig, count: int
) -> list[tuple[int, int, NDArray[np.float64]]]:
    """(true row, pixels, P(c|R)) of every object."""
    lit = IlluminantsConfig()
    gains = lights(lit)
    light, local = log_prior(gains, lit), local_lights(gains, lit)
    return [
        (truth, pixels, probabilities)
        for view in views
        for truth, pixels, probabilities in zip(
            view.truth,
            view.pixels,
            believe(view.evidence, light, local, count, weights),
            strict=True,
        )
    ]


def loss(views: Sequence[View], weights: FusionConfig, count: int) -> float:
    """Mean of -ln P(what it is | R)."""
    found = [
        max(p[truth] if truth >= 0 else unknown(p), 1e-12)
        for truth, _, p in answers(views, weights, count)
    ]
    return float(-np.mean(np.log(found)))


def calibration(views: Sequence[View], weights: FusionConfig, count: int) -> float:
    """Expected calibration error of the most probable of the prior's objects and of none."""
    sure, right = [], []
    for truth, _, p in answers(views, weights, count):
        best = -1 if unknown(p) > p.max() else int(p.argmax())
        sure.append(unknown(p) if best < 0 else float(p[best]))
        right.append(best == truth)
    return expected_calibration_error(np.array(sure), np.array(right))


def line(name: str, views: Sequence[View], weights: FusionConfig, count: int, large: bool) -> str:
    """Hit rates of one set, and how sure it is that the prior does not hold the object."""
    found = [
        (truth, p)
        for truth, pixels, p in answers(views, weights, count)
        if pixels > LARGE or not large
    ]
    ranks = np.array([1 + int((p > p[truth]).sum()) for truth, p in found if truth >= 0])
    parts = [f"{name}, {f'over {LARGE} pixels' if large else 'all'}: {len(found)} objects"]
    if len(ranks):
        parts += [f"top-{k} {np.mean(ranks <= k):.3f}" for k in (1, 3, 10)]
    for label, inside in (("in", True), ("not in", False)):
        sure = [unknown(p) for truth, p in found if (truth >= 0) == inside]
        if sure:
            parts.append(f"P(not in prior) of those {label} it {np.mean(sure):.3f}")
    return ", ".join(parts)


if __name__ == "__main__":
    main()
