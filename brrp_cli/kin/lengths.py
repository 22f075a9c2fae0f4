"""What counts as near for a large object.

Kin differ by shares of their size: two pots of 30 cm by millimetres where two cups differ by
fractions of one. The lengths of the configuration are those of things of the usual size.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import KinConfig

# Of a fit's distances to what was seen, and to what was seen to be free.
LENGTHS = (
    "coarse_near",
    "sigma",
    "robust",
    "free_sigma",
    "near",
    "far",
    "tolerance",
    "slope",
    "lost",
    "bend_beyond",
    "distinct",
)


def for_size(config: KinConfig, seen: NDArray[np.floating]) -> KinConfig:
    """The configuration for an object of which points (n, 3), metres, were seen: its lengths are
    larger by as many times as the object is larger than `config.usual`.

    Costs are of distances over lengths, and so smaller. That is for walls that nobody saw, of which
    the completion knows nothing: it fills a pot whose mouth is turned away. Solids, and what the
    camera looks into, it completes well: there kin is to be off by no more than of any object.
    """
    low, high = np.quantile(seen, config.most, axis=0)
    larger = float(np.linalg.norm(high - low)) / config.usual
    if larger <= 1:
        return config
    closed, wall, opened = config.most_cost
    return replace(
        config,
        **{name: larger * getattr(config, name) for name in LENGTHS},
        most_cost=(closed / larger**2, wall, max(wall, opened / larger**2)),
    )
