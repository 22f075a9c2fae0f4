"""Retrieval on the painted scene, with a prior of its five things."""

import dataclasses
from pathlib import Path

from painted_scene import STRANGE, THINGS, photograph, write_things

from brrp_cli.config import FeatureConfig, preset
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.parameters import BuildParameters
from brrp_cli.prior.store import Prior, open_prior
from brrp_cli.retrieval.appearance import AppearanceRetriever

PLACES = {3: (-0.15, 0.1), 4: (0.12, 0.14), 8: (0.0, -0.02), 9: (0.2, -0.1), 11: (-0.2, -0.14)}
STRANGER = 20
# Rounds of one object each, none of which ends them.
ONE_BY_ONE = {
    "tried": (1,),
    "glanced": (0.0,) * 4,
    "least": 1,
    "margin": 100.0,
    "unaligned": 0.1,
    "certain": 0.0,
    "at_once": 0.0,
}


# Of a reconstruction where what is recognised matters, and little is asked of the meshes.
COARSE = """
[features]
scales = [1.0]
[hypotheses.mean]
nodes = 20_000
[hypotheses.map]
hinges = 200
steps = 5
[surface]
nodes = 20_000
"""


def write_coarse(folder: Path) -> Path:
    """A file of `COARSE`."""
    path = folder / "coarse.toml"
    path.write_text(COARSE)
    return path


def painted_prior(folder: Path) -> Prior:
    parameters = BuildParameters(
        samples=400,
        surface_points=200,
        dense_points=2_000,
        features=FeatureConfig(scales=(1.0,)),
    )
    build_prior(write_things(folder / "meshes"), folder / "prior", parameters, workers=1)
    return open_prior(folder / "prior")


def retriever_of(prior, name="default", worth=None, **numbers):
    """With other numbers of alignment; worth : nats of an alignment score of 1, where the rounds
    end."""
    config = preset(name)
    retrieval = config.retrieval
    own = dataclasses.replace(
        retrieval, alignment=dataclasses.replace(retrieval.alignment, **numbers)
    )
    if worth is not None:
        own = dataclasses.replace(own, steering=dataclasses.replace(own.steering, alignment=worth))
    return AppearanceRetriever(prior, dataclasses.replace(config, retrieval=own), 0)


def scene(light=(1.0, 1.0, 1.0)):
    names = dict(zip(PLACES, THINGS, strict=True))
    placed = {i: (*THINGS[name], *PLACES[i]) for i, name in names.items()}
    return photograph(placed | {STRANGER: (*STRANGE, 0.0, 0.2)}, light), names
