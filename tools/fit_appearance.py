"""Fit the constants of retrieval by appearance on made scenes, or report with those in the code.

    python tools/fit_appearance.py --prior prior/ fit_prior/ fit_unseen/ fit_other/
    python tools/fit_appearance.py --prior prior/ --report test_prior/ test_unseen/ test_other/
    python tools/fit_appearance.py --prior prior/ --absent --report test_prior/

Scenes of objects that the prior holds and of others, made with `tools/make_scenes.py --noise
structured-light --light varied` or `--sensor`; every view counts, with `--segment` once more with
masks from depth. What is minimised is the mean of -ln P(what it is | R), where what is not in the
prior is one more class. With `--absent` every view counts once more with the true objects left out
of the prior: strangers of the same kinds. Several `--prior` fit one set of constants to priors of
different sizes. Printed are the values for FusionConfig in brrp_cli/config/retrieval.py, and what
becomes of each set.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message
from shown_object import shown_object

from brrp_cli.config import preset
from brrp_cli.config.retrieval import FusionConfig, IlluminantsConfig
from brrp_cli.evaluation.calibration import expected_calibration_error
from brrp_cli.ground_truth.scenes import find_scenes
from brrp_cli.prior.store import Prior, open_prior
from brrp_cli.progress import progress
from brrp_cli.retrieval.appearance import AppearanceRetriever
from brrp_cli.retrieval.base import unknown
from brrp_cli.retrieval.illuminants import lights, local_lights, log_prior
from brrp_cli.retrieval.score_fusion import Similarity, believe
from brrp_cli.segmentation.segment import segment

LARGE = 500  # visible pixels
TAKEN = 0.5  # probability


@dataclass(frozen=True)
class View:
    """What one view shows: evidence, visible pixels and the true row (-1: not in the prior), of
    `count` objects."""

    group: str
    count: int
    evidence: list[Similarity]
    pixels: list[int]
    truth: list[int]


@click.command()
@click.option("--prior", "priors", required=True, multiple=True, type=click.Path(path_type=Path))
@click.option("--absent", is_flag=True, help="Also as strangers: left out of the prior.")
@click.option("--segment", "segmented", is_flag=True, help="Masks from the frame alone, too.")
@click.option("--report", is_flag=True, help="Fit nothing: report with the constants in the code.")
@click.argument("sets", nargs=-1, required=True, type=click.Path(path_type=Path))
@one_message()
def main(
    priors: tuple[Path, ...], absent: bool, segmented: bool, report: bool, sets: tuple[Path, ...]
) -> None:
    """Fit on SETS, folders of scenes, and print constants and hit rates."""
    views = []
    for path in priors:
        prior = open_prior(path)
        masks = (False, True) if segmented else (False,)
        seen = [view for folder in sets for made in masks for view in look(prior, folder, made)]
        views += seen + ([left_out(view) for view in seen] if absent else [])
    in_use = preset("default").retrieval.fusion
    weights = in_use if report else fit(views, in_use)
    for count in sorted({view.count for view in views}):
        members = [view for view in views if view.count == count]
        click.echo(f"{count} objects: {weights}, mean loss {loss(members, weights):.4f}")
        click.echo(f"{count} objects: calibration error {calibration(members, weights):.3f}")
        for group in dict.fromkeys(view.group for view in members):
            for large in (True, False):
                here = [view for view in members if view.group == group]
                click.echo(f"{count}, {line(group, here, weights, large)}")


def look(prior: Prior, folder: Path, segmented: bool) -> list[View]:
    """The evidence of all views of all scenes in a folder; if `segmented`, of masks from depth,
    each of the object that most of its pixels show."""
    retriever = AppearanceRetriever(prior, preset("default"), 0)
    views = []
    for scene in progress(find_scenes(folder), folder.name):
        for index in range(len(scene.views)):
            given = scene.view(index)
            frame = replace(given, segmap=segment(given)) if segmented else given
            found = retriever.evidence(frame)
            shown = [shown_object(frame.segmap == i, given) for i in found]
            names = [scene.object(i).name if i else "" for i in shown]
            views.append(
                View(
                    group=folder.name + (", masks from depth" if segmented else ""),
                    count=len(prior.names),
                    evidence=list(found.values()),
                    pixels=[int(np.count_nonzero(frame.segmap == i)) for i in found],
                    truth=[prior.names.index(n) if n in prior.names else -1 for n in names],
                )
            )
    return views


def left_out(view: View) -> View:
    """What a prior without the true objects would have said."""
    return replace(
        view,
        group=f"{view.group} left out",
        evidence=[without(item, row) for item, row in zip(view.evidence, view.truth, strict=True)],
        truth=[-1] * len(view.truth),
    )


def without(item: Similarity, row: int) -> Similarity:
    """The evidence without one row of the prior."""
    kept = item.rows != row

    def part(values: NDArray[np.float32] | float) -> NDArray[np.float32] | float:
        return values[kept] if isinstance(values, np.ndarray) else values

    return replace(
        item,
        rows=item.rows[kept],
        colour=item.colour[:, kept],
        pairs=item.pairs[kept],
        size=item.size[kept],
        alignment=part(item.alignment),
        bare=part(item.bare),
        spilled=part(item.spilled),
    )


def fit(views: Sequence[View], in_use: FusionConfig) -> FusionConfig:
    """The weights with the least loss, all of them positive; what depends on the sensor, and the
    sizes of priors, stay."""
    from scipy.optimize import minimize

    begin = {k: v for k, v in asdict(in_use).items() if k not in ("usual", "wave", "few", "many")}

    def weights(x: NDArray[np.float64]) -> FusionConfig:
        found = zip(begin, np.exp(x), strict=True)
        return replace(in_use, **{name: round(float(value), 3) for name, value in found})

    best = minimize(
        lambda x: loss(views, weights(x)),
        np.log(list(begin.values())),
        method="Powell",
        options={"xtol": 5e-2, "ftol": 1e-4, "maxfev": 400},
    )
    return weights(best.x)


def answers(
    views: Sequence[View], weights: FusionConfig
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
            believe(view.evidence, light, local, view.count, weights),
            strict=True,
        )
    ]


def loss(views: Sequence[View], weights: FusionConfig) -> float:
    """Mean of -ln P(what it is | R)."""
    found = [
        max(p[truth] if truth >= 0 else unknown(p), 1e-12)
        for truth, _, p in answers(views, weights)
    ]
    return float(-np.mean(np.log(found)))


def calibration(views: Sequence[View], weights: FusionConfig) -> float:
    """Expected calibration error of the most probable of the prior's objects and of none."""
    sure, right = [], []
    for truth, _, p in answers(views, weights):
        best = -1 if unknown(p) > p.max() else int(p.argmax())
        sure.append(unknown(p) if best < 0 else float(p[best]))
        right.append(best == truth)
    return expected_calibration_error(np.array(sure), np.array(right))


def line(name: str, views: Sequence[View], weights: FusionConfig, large: bool) -> str:
    """Hit rates of one set, and how sure it is that the prior does not hold the object."""
    found = [
        (truth, p) for truth, pixels, p in answers(views, weights) if pixels > LARGE or not large
    ]
    ranks = np.array([1 + int((p > p[truth]).sum()) for truth, p in found if truth >= 0])
    parts = [f"{name}, {f'over {LARGE} pixels' if large else 'all'}: {len(found)} objects"]
    if len(ranks):
        parts += [f"top-{k} {np.mean(ranks <= k):.3f}" for k in (1, 3, 10)]
    for label, inside in (("in", True), ("not in", False)):
        sure = [unknown(p) for truth, p in found if (truth >= 0) == inside]
        if sure:
            parts.append(f"P(not in prior) of those {label} it {np.mean(sure):.3f}")
    strangers = [p for truth, p in found if truth < 0]
    if strangers:
        taken = np.mean([p.max(initial=0) > TAKEN for p in strangers])
        parts.append(f"strangers taken for a stored one {taken:.3f}")
    return ", ".join(parts)


if __name__ == "__main__":
    main()
