"""`brrp fetch clip` and what follows from it, through the commands."""

from __future__ import annotations

import functools
import http.server
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
import trimesh
from click.testing import CliRunner, Result

from brrp_cli.cli import main
from brrp_cli.config import preset
from brrp_cli.fetch import download
from brrp_cli.frames.frame import Frame
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.parameters import BuildParameters
from brrp_cli.prior.store import open_prior
from brrp_cli.retrieval.base import top_k
from brrp_cli.retrieval.choose import choose_retriever, resolve_name
from brrp_cli.retrieval.clip.model_files import clip_cache

pytestmark = pytest.mark.usefixtures("manifest")


@pytest.fixture(autouse=True)
def fresh_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.setattr(download, "PAUSE", 0)


@pytest.fixture
def mirror(published: Path) -> Iterator[str]:
    """Python's own file server, which knows nothing of ranges."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *args: object) -> None:
            pass

    handler = functools.partial(Quiet, directory=str(published))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()
    thread.join()


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def fetch(*arguments: object) -> Result:
    return run("fetch", "clip", *arguments)


def left(folder: Path) -> list[str]:
    files = (p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())
    return sorted(name for name in files if name != ".lock")


@pytest.fixture(scope="module")
def meshes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("meshes")
    for number, colour in enumerate(("red", "green", "blue")):
        trimesh.creation.box((0.1, 0.1, 0.05 + 0.01 * number)).export(folder / f"{colour}_box.ply")
    return folder


@pytest.fixture(scope="module")
def built(meshes: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A prior without text embeddings."""
    prior = tmp_path_factory.mktemp("prior") / "prior"
    build_prior(meshes, prior, BuildParameters(samples=100), workers=1)
    return prior


@pytest.fixture
def prior(built: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(built, tmp_path / "prior"))


def build(meshes: Path, prior: Path, *arguments: object) -> Result:
    return run("build-prior", meshes, "-o", prior, "--samples", 100, "--workers", 1, *arguments)


def test_what_is_fetched_is_what_auto_uses(
    mirror: str, meshes: Path, prior: Path, coloured_frame: Frame
) -> None:
    """From the network to the answer; at the end only the vision model is left."""
    assert resolve_name("auto") == "appearance"
    done = fetch("--from", mirror)
    assert done.exit_code == 0, done.output
    assert "3 files fetched, 0 there already" in done.stdout and str(clip_cache()) in done.stdout
    assert "0 files fetched, 3 there already" in fetch("--from", mirror).stdout
    assert resolve_name("auto") == "clip"

    for _ in range(2):
        assert build(meshes, prior).exit_code == 0
        assert len(list((prior / "clip").glob("text-*.npz"))) == 1
    verified = run("verify", prior)
    assert verified.exit_code == 0 and "all is well" in verified.stdout

    (clip_cache() / "onnx/text_model.onnx").unlink()
    (clip_cache() / "tokenizer.json").unlink()
    opened = open_prior(prior)
    retriever = choose_retriever("auto", opened, preset("default"), 0)
    assert retriever.name == "clip"
    best = top_k(retriever.probabilities(coloured_frame, 7), opened.names, 1)
    assert best[0][0] == "red_box"


def test_8_bit_into_a_folder_of_ones_own(mirror: str, tmp_path: Path) -> None:
    done = fetch("--from", mirror, "--precision", "8bit", "--clip-dir", tmp_path / "clip")
    assert done.exit_code == 0, done.output
    assert left(tmp_path / "clip") == [
        "onnx/text_model_quantized.onnx",
        "onnx/vision_model_quantized.onnx",
        "tokenizer.json",
    ]
    assert resolve_name("auto") == "appearance"
    assert resolve_name("auto", tmp_path / "clip") == "clip"


def test_the_folder_that_the_variable_names_is_filled(
    published: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BRRP_CLIP_DIR", str(tmp_path / "named"))
    assert fetch("--from", published).exit_code == 0
    assert (tmp_path / "named/tokenizer.json").is_file()
    assert not clip_cache().exists()


def test_a_mirror_with_a_wrong_model_leaves_no_clip(published: Path, tmp_path: Path) -> None:
    wrong = Path(shutil.copytree(published, tmp_path / "wrong"))
    model = wrong / "onnx/vision_model.onnx"
    model.write_bytes(model.read_bytes()[:-1] + b"?")
    done = fetch("--from", wrong)
    assert done.exit_code == 1
    assert "not the one that was asked for" in done.stderr and "vision_model.onnx" in done.stderr
    assert left(clip_cache()) == ["onnx/text_model.onnx", "tokenizer.json"]
    assert resolve_name("auto") == "appearance"
    assert fetch("--from", published).exit_code == 0
    assert resolve_name("auto") == "clip"


def test_without_a_network_the_message_says_how_to_go_on() -> None:
    """The manifest of these tests names an address that never resolves."""
    done = fetch()
    assert done.exit_code == 1
    assert "nowhere.invalid cannot be reached" in done.stderr
    assert "--clip-dir FOLDER on a machine that has one" in done.stderr
    assert left(clip_cache()) == []


def test_a_prior_is_built_whatever_clip_is_like(
    meshes: Path, prior: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """CLIP that the environment names is a help; CLIP that the command names is meant."""
    monkeypatch.setenv("BRRP_CLIP_DIR", str(tmp_path / "nothing"))
    done = build(meshes, prior)
    assert done.exit_code == 0 and "embeddings are not kept" in done.stderr
    asked = build(meshes, prior, "--clip-dir", tmp_path / "nothing")
    assert asked.exit_code == 1 and "no such CLIP folder" in asked.stderr
