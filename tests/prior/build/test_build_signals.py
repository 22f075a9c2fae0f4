"""The builder as a process with workers: signals, kills at any time, several at once, readers."""

from __future__ import annotations

import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import trimesh
from small_prior import prior_bytes

import brrp_cli
from brrp_cli.errors import PriorError
from brrp_cli.prior.build import build
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.build.shard_plan import plan_shards
from brrp_cli.prior.shard import object_names, open_shard
from brrp_cli.prior.store import open_prior, verify_prior
from brrp_cli.stop import StoppedError

# Runs the command's own entry with parameters that take a second, not a minute.
SCRIPT = """
import sys
from pathlib import Path
sys.path[:0] = {paths!r}
if __name__ == "__main__":
    import click
    from test_build_faults import TINY
    from brrp_cli.cli import LazyGroup
    from brrp_cli.prior.build.build import build_prior

    @click.group(cls=LazyGroup)
    def main(): pass

    @click.command("build")
    def command():
        build_prior(Path(sys.argv[2]), Path(sys.argv[3]), TINY, **{workers!r})

    LazyGroup.get_command = lambda self, ctx, name: command
    sys.argv[1:] = ["build", *sys.argv[1:]]
    main(["build"])
"""
pytestmark = pytest.mark.long

NAMES = ["ad", "ae", "af", "ah"]


@pytest.fixture(scope="module")
def boxes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("boxes")
    for i, name in enumerate(NAMES):
        trimesh.creation.box((0.05 + 0.01 * i, 0.04, 0.03)).export(folder / f"{name}.ply")
    return folder


@pytest.fixture(scope="module")
def script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written_script(tmp_path_factory, {"workers": 2})


@pytest.fixture(scope="module")
def dask_script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written_script(tmp_path_factory, {"scheduler": "local:2"})


def written_script(tmp_path_factory: pytest.TempPathFactory, workers: dict[str, object]) -> Path:
    path = tmp_path_factory.mktemp("script") / "build_it.py"
    paths = [
        str(Path(brrp_cli.__file__).parents[1]),
        str(Path(__file__).parent),
        str(Path(__file__).parents[2] / "support"),
    ]
    path.write_text(SCRIPT.format(paths=paths, workers=workers))
    return path


@pytest.fixture(scope="module")
def wanted(boxes: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    from test_build_faults import TINY

    out = tmp_path_factory.mktemp("wanted")
    build_prior(boxes, out, TINY, workers=1)
    return prior_bytes(out)


def hears_ctrl_c() -> None:
    """A shell lets its background processes, and theirs, ignore it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def start(script: Path, boxes: Path, out: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, script, boxes, out],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=hears_ctrl_c,
    )


def finished(script: Path, boxes: Path, out: Path) -> None:
    with start(script, boxes, out) as process:
        _, told = process.communicate()
    assert process.returncode == 0, told


def count_objects(path: Path) -> int:
    with open_shard(path) as shard:
        return len(object_names(shard))


def wait_for_a_shard(process: subprocess.Popen[str], out: Path) -> None:
    while not list(out.glob("shards/shard-*.h5")) and process.poll() is None:
        time.sleep(0.005)


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("group", [False, True], ids=["process", "group"])
@pytest.mark.parametrize("where", ["script", "dask_script"])
def test_a_signal_ends_the_build_with_its_code_and_keeps_what_is_finished(
    sent: signal.Signals,
    code: int,
    group: bool,
    where: str,
    request: pytest.FixtureRequest,
    boxes: Path,
    wanted: dict[str, bytes],
    tmp_path: Path,
) -> None:
    """Ctrl-C, and service managers, signal the workers too."""
    script = request.getfixturevalue(where)
    assert len(plan_shards(NAMES)) == 3
    out = tmp_path / "prior"
    with start(script, boxes, out) as process:
        wait_for_a_shard(process, out)
        (os.killpg if group else os.kill)(process.pid, sent)
        _, told = process.communicate()
    assert process.returncode == code, told
    assert "Traceback" not in told and "run the same command again to go on" in told
    assert not (out / "manifest.json").exists() and not list(out.rglob("*.partial*"))
    made = re.search(r"([1-4]) of 4 objects made in this run; they are kept", told)
    assert made, told
    # A shard of which a part was made holds that part, and gives way to the whole one.
    assert sum(count_objects(path) for path in out.glob("shards/*")) == int(made[1])
    finished(script, boxes, out)
    assert prior_bytes(out) == wanted


def test_ctrl_c_while_a_shard_is_written_loses_none_of_its_objects(
    boxes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from test_build_faults import TINY

    write, calls = build.write_shard, []

    def interrupted(*given: object) -> None:
        calls.append(given)
        if len(calls) == 1:
            raise KeyboardInterrupt
        write(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(build, "write_shard", interrupted)
    with pytest.raises(StoppedError) as stop:
        build_prior(boxes, tmp_path / "prior", TINY, workers=1)
    made = re.search(r"([1-4]) of 4 objects made in this run; they are kept", str(stop.value))
    assert made, stop.value
    kept = (tmp_path / "prior").glob("shards/*")
    assert sum(count_objects(path) for path in kept) == int(made[1])


def test_a_build_killed_at_random_times_again_and_again_ends_with_the_same_bytes(
    script: Path, boxes: Path, wanted: dict[str, bytes], tmp_path: Path
) -> None:
    """Until 20 were hit: some builds end before the signal comes, most on a busy machine."""
    rng = random.Random(0)
    kills = attempt = 0
    while kills < 20:
        attempt += 1
        assert attempt <= 20, f"{kills} of {5 * attempt} builds were hit"
        out = tmp_path / f"prior{attempt}"
        start_time = time.monotonic()
        finished(script, boxes, out)
        whole = time.monotonic() - start_time
        shutil.rmtree(out)
        for _ in range(5):
            with start(script, boxes, out) as process:
                try:
                    process.wait(rng.uniform(0.3, 1.1) * whole)
                except subprocess.TimeoutExpired:
                    # The parent alone: workers find out by themselves.
                    process.kill()
                    kills += 1
                process.communicate()
        finished(script, boxes, out)
        assert prior_bytes(out) == wanted


@pytest.mark.parametrize("count", [2, 8])
def test_of_several_builders_one_builds_and_the_others_are_told(
    count: int, script: Path, boxes: Path, wanted: dict[str, bytes], tmp_path: Path
) -> None:
    out = tmp_path / "prior"
    crew = [start(script, boxes, out) for _ in range(count)]
    ends = [(process.communicate()[1], process.returncode) for process in crew]
    # One that comes after another has ended finds nothing to do.
    assert sum(code == 0 for _, code in ends) >= 1
    for told, code in ends:
        assert code == 0 or (code == 1 and "Another build is at work" in told), told
    assert prior_bytes(out) == wanted


def test_a_dead_builder_holds_no_lock(
    script: Path, boxes: Path, wanted: dict[str, bytes], tmp_path: Path
) -> None:
    out = tmp_path / "prior"
    with start(script, boxes, out) as process:
        wait_for_a_shard(process, out)
        # Its workers are left alive, as they are after a kill by the kernel.
        process.kill()
        process.wait()
        finished(script, boxes, out)
    assert prior_bytes(out) == wanted


def test_readers_see_a_whole_prior_at_every_moment(
    script: Path, boxes: Path, tmp_path: Path
) -> None:
    """The meshes change again and again; a reader opens, loads and verifies meanwhile."""
    meshes = Path(shutil.copytree(boxes, tmp_path / "meshes"))
    out = tmp_path / "prior"
    finished(script, meshes, out)
    reads, moved, digests = 0, 0, set()
    for i in range(6):
        trimesh.creation.box((0.05 + 0.01 * i, 0.07, 0.02)).export(meshes / "ae.ply")
        with start(script, meshes, out) as process:
            while process.poll() is None:
                prior = open_prior(out)
                digests.add(prior.digest)
                try:
                    for name in prior.names:
                        prior.load(name)
                    reads += 1
                except PriorError as error:
                    # It was replaced between opening and reading, and says so.
                    moved += 1
                    assert "open the prior again" in str(error)
            assert process.returncode == 0, process.communicate()[1]
    assert verify_prior(open_prior(out)) == []
    assert reads > 20 and len(digests) >= 6 and moved <= 12
