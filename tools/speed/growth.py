"""How the time of a frame grows with one thing at a time."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from copy_prior import copy_prior

from brrp_cli.config import Config
from brrp_cli.frames.frame import Frame
from brrp_cli.prior.store import Prior, open_prior
from speed.frames import with_objects, with_pixels

PIXELS = (0.5, 1.0, 2.0)
PARTICLES = (4, 8, 16, 32)
HINGES = (500, 1000, 2000, 4000)
PRIORS = (1, 10, 100)

Case = tuple[str, float, Frame, Prior, Config]


def cases(frame: Frame, prior: Prior, config: Config, *, quick: bool) -> Iterator[Case]:
    """(what grows, how much of it, and all that is then timed); `quick` leaves out the largest."""
    last = -1 if quick else None
    for count in range(1, len(frame.object_ids) + 1)[:last]:
        yield "objects", count, with_objects(frame, count), prior, config
    for factor in PIXELS[:last]:
        changed = with_pixels(frame, factor)
        yield "pixels", changed.segmap.size, changed, prior, config
    for count in PARTICLES[:last]:
        yield "particles", count, frame, prior, _with_map(config, particles=count)
    for count in HINGES[:last]:
        yield "hinge points", count, frame, prior, _with_map(config, hinges=count)
    with tempfile.TemporaryDirectory() as folder:
        for factor in PRIORS[:last]:
            count = factor * len(prior.names)
            path = Path(folder) / str(count)
            path.mkdir()
            copy_prior(prior, count, path, strange=True)
            yield "stored objects", count, frame, open_prior(path), config


def _with_map(config: Config, **changes: int) -> Config:
    assert config.hypotheses is not None
    changed = replace(config.hypotheses.map, **changes)
    return replace(config, hypotheses=replace(config.hypotheses, map=changed))
