"""The shapes of a prior for kin, kept beside it: the same as made, whatever becomes of the file."""

import shutil
from dataclasses import fields, replace

import numpy as np
import pytest

from brrp_cli.config import Config
from brrp_cli.kin import kept_library
from brrp_cli.kin.kept_library import kept_path, kin_library
from brrp_cli.kin.library import Fields, Library, library_of_prior
from brrp_cli.prior.store import open_prior, verify_prior

KIN = replace(Config().hypotheses.kin, nodes=8)


@pytest.fixture(autouse=True)
def nothing_in_memory(monkeypatch):
    monkeypatch.setattr(kept_library, "_MADE", kept_library.OrderedDict())


@pytest.fixture
def made(prior):
    return library_of_prior(prior, KIN)


def refuse(*_):
    raise AssertionError("nothing was to be made")


def assert_same(found: Library, made: Library) -> None:
    for each in fields(Library):
        if each.name != "fields":
            np.testing.assert_array_equal(getattr(found, each.name), getattr(made, each.name))
    for each in fields(Fields):
        one, other = getattr(found.fields, each.name), getattr(made.fields, each.name)
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)


def test_what_is_kept_is_what_was_made_and_is_not_made_again(prior, made, monkeypatch):
    assert_same(kin_library(prior, KIN), made)
    kept_library._MADE.clear()
    monkeypatch.setattr(kept_library, "library_of_prior", refuse)
    found = kin_library(prior, KIN)
    assert_same(found, made)
    assert kin_library(prior, KIN) is found
    assert verify_prior(prior) == []


def test_other_numbers_take_its_place_and_those_that_decide_nothing_do_not(prior):
    kin_library(prior, KIN)
    assert kept_path(prior, replace(KIN, convincing=0.9)) == kept_path(prior, KIN)
    fewer = kin_library(prior, replace(KIN, poses=1))
    assert len(fewer.object) == 3
    assert [path.name for path in kept_path(prior, KIN).parent.iterdir()] == [
        kept_path(prior, replace(KIN, poses=1)).name
    ]


@pytest.mark.parametrize("damage", ["cut", "flipped", "text", "lacks"])
def test_a_damaged_file_is_made_anew(prior, made, damage):
    kin_library(prior, KIN)
    path = kept_path(prior, KIN)
    whole = path.read_bytes()
    if damage == "lacks":
        np.savez(path, names=np.array(["box"]))
    else:
        middle = len(whole) // 2
        flipped = whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
        path.write_bytes({"cut": whole[:middle], "flipped": flipped, "text": b"no zip"}[damage])
    kept_library._MADE.clear()
    assert_same(kin_library(prior, KIN), made)
    assert path.read_bytes() == whole


def test_a_prior_that_cannot_be_written_is_used_all_the_same(prior, made, tmp_path):
    blocked = tmp_path / "prior"
    shutil.copytree(prior.path, blocked, ignore=lambda *_: ["kin"])
    (blocked / "kin").write_text("a file where the folder would be")
    assert_same(kin_library(open_prior(blocked), KIN), made)
