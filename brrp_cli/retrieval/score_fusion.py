"""From likeness to probability: every object of a frame at once, in one unknown light.

For object i of the frame, stored object c and light g, with n stored objects:

    s_i(c, g) = max(1, min(n, many) / few)^sharper (
                offset + colour (B_i(c, g) - 1) + pairs (1 - h_i) (D_i(c) - 1) + size Z_i(c)
                + [alignment (A_i(c) - A_i) + fit_i (A_i - usual)] m_i / (m_i + points)
                - bare_i min(b_i(c), most_bare) - spilled_i ln(1 + o_i(c))
                - crowding ln n),    fit_i = fit min(1, wave / w), and so bare_i, spilled_i

B and D are Bhattacharyya coefficients of colours and of point pairs, in [0, 1], h the hidden share
of the silhouette, Z <= 0 what speaks against the size and A <= 1 the alignment score of c laid over
the m points that are seen, A_i the best of them: many shapes lie well over a few points, and none
lies well over depth with waves of deviation w. b is the share of the mask that c then leaves bare,
o what it covers beside the mask (registration/silhouette.py). s is the log of the odds of c against
"not in the prior" in light g. The light l of the scene is common to its objects, and that on each
of them is near it:

    P(l | others) ~ P(l) prod_{j != i} sum_g P(g | l) (1 + sum_c exp s_j(c, g))
    P(c | R) ~ sum_l P(l | others) sum_g P(g | l) exp s_i(c, g),    P(none | R) ~ 1
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.retrieval import FusionConfig


@dataclass(frozen=True)
class Similarity:
    """How alike one seen object is to some stored objects.

    rows : (m,) which of the prior's n objects; colour : (g, m), one row for each light;
    pairs : (m,); size : (m,), 0 or less; alignment : (m,), or 1 for all; bare, spilled : (m,),
    shares of the mask that its placement leaves bare, and covers beside it, or 0 for all;
    hidden : share of the silhouette; points : observed, that objects are aligned with; wave :
    metres, by which their depth errs over patches (observation/sensor_noise.py)
    """

    rows: NDArray[np.int64]
    colour: NDArray[np.float32]
    pairs: NDArray[np.float32]
    size: NDArray[np.float32]
    hidden: float
    points: int
    alignment: NDArray[np.float32] | float = 1.0
    bare: NDArray[np.float32] | float = 0.0
    spilled: NDArray[np.float32] | float = 0.0
    wave: float = 0.0


def believe(
    evidence: Sequence[Similarity],
    light: NDArray[np.floating],
    local: NDArray[np.floating],
    count: int,
    weights: FusionConfig,
) -> list[NDArray[np.float64]]:
    """P(c|R) (count,) for each seen object of one frame; what is missing from 1 is P(none|R).

    light : (g,) log prior of the scene's light; local : (g, g), P(light on an object | that of the
    scene), rows sum to 1; count : objects of the prior
    """
    from scipy.special import logsumexp, softmax

    odds = [_log_odds(item, count, weights) for item in evidence]
    votes = [np.log1p(local @ np.exp(logsumexp(s, axis=1))) for s in odds]
    total = light + np.sum(votes, axis=0)
    found = []
    for item, s, vote in zip(evidence, odds, votes, strict=True):
        here = softmax(total - vote) @ local
        share = here @ np.exp(s)
        probabilities = np.zeros(count)
        probabilities[item.rows] = share / (1 + share.sum())
        found.append(probabilities)
    return found


def against_silhouettes(
    bare: NDArray[np.floating] | float,
    spilled: NDArray[np.floating] | float,
    wave: float,
    weights: FusionConfig,
) -> NDArray[np.float64]:
    """What the silhouettes of placements say against them, nats: see `Similarity`."""
    unlike = weights.bare * np.minimum(bare, weights.most_bare)
    unlike = unlike + weights.spilled * np.log1p(spilled)
    return np.asarray(_clear(wave, weights) * unlike, dtype=np.float64)


def _clear(wave: float, weights: FusionConfig) -> float:
    """How much counts what waves and blurred edges of depth make worse for all objects."""
    return weights.wave / max(weights.wave, wave)


def looks_difference(
    item: Similarity, weights: FusionConfig, others: FusionConfig
) -> NDArray[np.float64]:
    """Nats (m,) by which looks count for more with the weights `others`: point pairs, size, and
    colours in the light in which they are most alike."""
    return _by_looks(item, others) - _by_looks(item, weights)


def _by_looks(item: Similarity, weights: FusionConfig) -> NDArray[np.float64]:
    colour = weights.colour * (item.colour.max(axis=0).astype(np.float64) - 1)
    return np.asarray(colour + by_shape(item, weights))


def by_shape(item: Similarity, weights: FusionConfig) -> NDArray[np.float64]:
    """What point pairs and size say for each object, nats (m,), 0 or less."""
    pairs = weights.pairs * (1 - item.hidden) * (item.pairs.astype(np.float64) - 1)
    return np.asarray(pairs + weights.size * item.size)


def _log_odds(item: Similarity, count: int, weights: FusionConfig) -> NDArray[np.float64]:
    shape = by_shape(item, weights)
    sure = item.points / (item.points + weights.points)
    best = np.max(item.alignment)
    behind = weights.alignment * (item.alignment - best)
    clear = _clear(item.wave, weights)
    shape = shape + sure * (behind + weights.fit * clear * (best - weights.usual))
    shape = shape - against_silhouettes(item.bare, item.spilled, item.wave, weights)
    colour = weights.colour * (item.colour.astype(np.float64) - 1)
    odds = weights.offset + colour + shape - weights.crowding * np.log(count)
    larger = max(1.0, min(count, weights.many) / weights.few)
    return np.asarray(larger**weights.sharper * odds)
