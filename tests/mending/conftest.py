"""What a painted prior and a frame of its things need to be mended."""

from functools import partial

import pytest
from painted_retrieval import painted_prior, write_coarse
from regroup_scene import table_of_things

from brrp_cli import load_config
from brrp_cli.api import reconstruct, try_masks
from brrp_cli.mending.again import Again
from brrp_cli.retrieval.appearance import AppearanceRetriever


@pytest.fixture(scope="package")
def prior(tmp_path_factory):
    return painted_prior(tmp_path_factory.mktemp("painted"))


@pytest.fixture(scope="package")
def config_file(tmp_path_factory):
    return write_coarse(tmp_path_factory.mktemp("config"))


@pytest.fixture(scope="module")
def given(prior, config_file):
    # One retriever, as in a command: what it saw of a mask counts for all frames of the image.
    config = load_config(config_file)
    retriever = AppearanceRetriever(prior, config, 0)
    return {"prior": prior, "config": config, "retriever": retriever, "workers": 1}


@pytest.fixture(scope="module")
def truth():
    return table_of_things()


@pytest.fixture(scope="module")
def again(given):
    return Again(partial(reconstruct, **given), partial(try_masks, **given))
