from pathlib import Path

import numpy as np
import pytest
from painted_retrieval import painted_prior, retriever_of
from small_clip import RGB, write_immich, write_manifest, write_xenova

from brrp_cli.frames.frame import Frame
from brrp_cli.prior.store import Prior
from brrp_cli.retrieval.appearance import AppearanceRetriever


@pytest.fixture(scope="session")
def xenova(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_xenova(tmp_path_factory.mktemp("xenova"))


@pytest.fixture(scope="session")
def immich(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_immich(tmp_path_factory.mktemp("immich"))


@pytest.fixture(scope="session")
def published(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A repository in the Xenova layout with both precisions, which differ in gain only."""
    folder = write_xenova(tmp_path_factory.mktemp("published"))
    return write_xenova(folder, suffix="_quantized", text_gain=2, gain=0.5)


@pytest.fixture
def manifest(published: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The package's manifest names the models of `published` instead of those of the hub."""
    path = write_manifest(tmp_path / "clip.toml", published)
    monkeypatch.setattr("brrp_cli.retrieval.clip.manifest.MANIFEST", path)
    return path


@pytest.fixture
def coloured_frame() -> Frame:
    """Objects 7 (red), 250 (green) and 3 (blue) on grey."""
    rgb = np.full((60, 80, 3), 127, dtype=np.uint8)
    segmap = np.zeros((60, 80), dtype=np.int64)
    boxes = {"red": (7, 10, 5), "green": (250, 40, 20), "blue": (3, 30, 55)}
    for colour, (object_id, row, column) in boxes.items():
        rgb[row : row + 12, column : column + 20] = RGB[colour]
        segmap[row : row + 12, column : column + 20] = object_id
    return Frame(
        rgb=rgb, points=np.ones((60, 80, 3), np.float32), segmap=segmap, K=np.eye(3, dtype=float)
    )


@pytest.fixture(scope="session")
def prior(tmp_path_factory: pytest.TempPathFactory) -> Prior:
    """The five painted things."""
    return painted_prior(tmp_path_factory.mktemp("painted"))


@pytest.fixture
def retriever(prior: Prior) -> AppearanceRetriever:
    return retriever_of(prior)
