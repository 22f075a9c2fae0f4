"""Whether a prior suits a configuration, told before any work is done with it."""

from __future__ import annotations

import json
from dataclasses import asdict

from brrp_cli.config import Config
from brrp_cli.errors import PriorError
from brrp_cli.prior.parameters import differences
from brrp_cli.prior.store import Prior


def check_prior(prior: Prior, config: Config) -> None:
    """PriorError unless the prior's clouds and features were made as `config` makes them."""
    # As JSON gives it back: tuples are lists.
    wanted = json.loads(json.dumps(asdict(config.features)))
    features = prior.parameters.get("features")
    lines = differences(features if isinstance(features, dict) else {}, wanted)
    if lines:
        raise PriorError(
            "The prior's features are not those of the configuration",
            where=prior.path,
            found="; ".join(lines),
            fix="build the prior anew, or use the configuration that it was built for",
        )
