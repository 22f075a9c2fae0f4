"""Which retriever a name means, and CLIP and appearance as one."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from small_prior import SMALL

from brrp_cli.config import preset
from brrp_cli.errors import RetrievalError
from brrp_cli.frames.frame import Frame
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.store import Prior, open_prior
from brrp_cli.retrieval.base import unknown
from brrp_cli.retrieval.choose import choose_retriever, resolve_name
from brrp_cli.retrieval.clip import model_files as clip_files
from brrp_cli.retrieval.combined import BothRetriever
from brrp_cli.retrieval.table import TableRetriever

CONFIG = preset("default")
NAMES = ["a", "b", "c"]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Boxes that are called by a colour and have none, so that appearance alone cannot choose."""
    meshes = tmp_path_factory.mktemp("meshes")
    for colour in ("red", "green", "blue"):
        trimesh.creation.box((0.1, 0.12, 0.14)).export(meshes / f"{colour}_box.ply")
    out = tmp_path_factory.mktemp("prior") / "prior"
    build_prior(meshes, out, SMALL, workers=1)
    return out


@pytest.fixture
def prior(built: Path, tmp_path: Path) -> Prior:
    return open_prior(shutil.copytree(built, tmp_path / "prior"))


@pytest.fixture
def fetched(xenova: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The cache as `brrp fetch clip` leaves it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return Path(shutil.copytree(xenova, clip_files.clip_cache()))


def test_auto_without_clip_is_appearance(prior: Prior) -> None:
    assert resolve_name("auto") == "appearance"
    assert choose_retriever("auto", prior, CONFIG, 0).name == "appearance"


@pytest.mark.usefixtures("fetched")
def test_auto_is_clip_where_it_was_fetched(prior: Prior) -> None:
    assert choose_retriever("auto", prior, CONFIG, 0).name == "clip"


def test_there_is_no_retriever_by_fitness(prior: Prior) -> None:
    with pytest.raises(RetrievalError, match="No such retriever"):
        choose_retriever("fitness", prior, CONFIG, 0)


def test_auto_is_clip_where_a_folder_is_named(
    prior: Prior, xenova: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert choose_retriever("auto", prior, CONFIG, 0, clip_dir=xenova).name == "clip"
    monkeypatch.setenv("BRRP_CLIP_DIR", str(xenova))
    assert choose_retriever("auto", prior, CONFIG, 0).name == "clip"


@pytest.mark.parametrize("name", ["clip", "both"])
def test_without_clip_the_message_says_how_to_come_by_it(prior: Prior, name: str) -> None:
    with pytest.raises(RetrievalError, match="brrp fetch clip"):
        choose_retriever(name, prior, CONFIG, 0)


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        ([0.2, 0.1, 0.1], [0.3, 0.3, 0.0], [0.4, 0.2, 0.0]),
        ([0.2, 0.6, 0.2], [0.5, 0.5, 0.0], [0.25, 0.75, 0.0]),
        ([0.0, 0.0, 0.9], [0.3, 0.5, 0.0], [0.3, 0.5, 0.0]),
        ([0.0, 0.0, 0.0], [0.3, 0.5, 0.1], [0.3, 0.5, 0.1]),
    ],
    ids=["both know strangers", "none does", "nothing in common", "the first knows none"],
)
def test_the_product_keeps_what_the_second_one_says_of_strangers(
    tmp_path: Path,
    coloured_frame: Frame,
    first: list[float],
    second: list[float],
    expected: list[float],
) -> None:
    tables = []
    for path, given in ((tmp_path / "1.json", first), (tmp_path / "2.json", second)):
        path.write_text(json.dumps({"7": dict(zip(NAMES, given, strict=True))}))
        tables.append(TableRetriever(path, NAMES))
    found = BothRetriever(*tables).probabilities(coloured_frame, 7)
    assert np.allclose(found, expected)
    assert np.isclose(unknown(found), 1 - sum(second))


def test_both_uses_the_fetched_folder_and_the_kept_embeddings(
    prior: Prior, fetched: Path, coloured_frame: Frame
) -> None:
    """Of boxes that differ by their names alone CLIP chooses; then the vision model suffices."""
    rows, columns = np.indices(coloured_frame.segmap.shape)
    wall = np.stack([columns / 100, rows / 100, np.ones(rows.shape)], axis=-1).astype(np.float32)
    frame = replace(coloured_frame, points=wall)
    appearance = choose_retriever("appearance", prior, CONFIG, 0)
    before = appearance.probabilities(frame, 7)
    # They are the same box, each with other points on its surface.
    np.testing.assert_allclose(before, before[0], rtol=0.1)
    found = choose_retriever("both", prior, CONFIG, 0).probabilities(frame, 7)
    assert prior.names[int(np.argmax(found))] == "red_box"
    assert np.isclose(found.sum(), before.sum())
    assert len(list((prior.path / "clip").glob("text-*.npz"))) == 1

    (fetched / "onnx/text_model.onnx").unlink()
    (fetched / "tokenizer.json").unlink()
    again = choose_retriever("both", prior, CONFIG, 0).probabilities(frame, 7)
    assert np.array_equal(again, found)
