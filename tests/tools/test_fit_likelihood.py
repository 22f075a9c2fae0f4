"""The fit of the likelihood counts as the likelihood does, and mends constants that were spoilt."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from fit_likelihood import fit, loss, ratios, with_likelihood
from likelihood.masks import Mask, as_json, placed, read

from brrp_cli.config import LikelihoodConfig, preset
from brrp_cli.registration.likelihood import PlacementEvidence, log_likelihood

CONFIG = preset("default")


def evidence(rng, *, right):
    """Of a placement that lies on what was seen, or is centimetres off."""
    count = int(rng.integers(5, 80))
    spread = 0.001 if right else 0.008
    return PlacementEvidence(
        residual=spread * rng.normal(size=count),
        variance=np.full(count, 1e-6),
        share=rng.uniform(0.3, 1, count),
        patches_per_vote=10.0,
        missed=float(rng.exponential(0.2 if right else 2)),
        covered=count / 10,
        free=float(rng.exponential(0.1 if right else 1)),
        unmasked=float(rng.exponential(0.1 if right else 1)),
        below=float(rng.uniform(0, 0.02 if right else 0.2)),
        colour=float(rng.uniform(0.3 if right else -0.3, 0.8)),
    )


def masks(count):
    rng = np.random.default_rng(0)
    likelihood = LikelihoodConfig()
    found = []
    for number in range(count):
        stored = bool(rng.random() < 0.5)
        rows = [
            placed(evidence(rng, right=right), likelihood, 0.4, resized=bool(i == 2), right=right)
            for i, right in enumerate((stored, False, False))
        ]
        found.append(Mask("made", "0", number, "thing", 2000, stored, 0.3, False, rows))
    return found


def test_it_counts_as_the_likelihood_does():
    rng = np.random.default_rng(1)
    for config in (LikelihoodConfig(), LikelihoodConfig(missed=9.0, most_votes=5.0, base=-1.0)):
        told = evidence(rng, right=False)
        row = placed(told, config, 0.5, resized=True, right=False)
        mask = Mask("made", "0", 1, "thing", 100, True, 0.2, False, [row])
        expected = log_likelihood(told, config) - config.other_size
        assert ratios(mask, config) == pytest.approx([expected])
        less = replace(config, depth=config.known_depth)
        expected = log_likelihood(told, less) - config.other_size
        assert ratios(replace(mask, aligned=True), config) == pytest.approx([expected])


def test_the_fit_undoes_constants_that_were_spoilt():
    found = masks(25)
    spoilt = with_likelihood(CONFIG, replace(LikelihoodConfig(), base=9.0, missed=0.5))
    fitted = fit(found, spoilt)
    assert fitted.base < 9 and fitted.missed > 0.5
    assert loss(found, with_likelihood(CONFIG, fitted)) < 0.5 * loss(found, spoilt)


def test_masks_are_read_as_they_were_written(tmp_path):
    path = tmp_path / "masks.jsonl"
    assert read(path) == []
    found = masks(3)
    path.write_text("".join(json.dumps(as_json(mask)) + "\n" for mask in found))
    assert read(path) == found


def test_constants_that_are_not_named_stay_as_they_are():
    spoilt = replace(LikelihoodConfig(), base=9.0, missed=0.5)
    fitted = fit(masks(25), with_likelihood(CONFIG, spoilt), ["base"])
    assert fitted.base < 9 and replace(fitted, base=9.0) == spoilt
