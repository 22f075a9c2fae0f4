import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import filelock
import pytest
import small_prior
import trimesh
from small_prior import prior_bytes

import brrp_cli
from brrp_cli.errors import MeshError, PriorError
from brrp_cli.prior.build import build
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.build.shard_plan import plan_shards
from brrp_cli.prior.parameters import BuildParameters
from brrp_cli.prior.store import open_prior, verify_prior


def test_workers_and_order_do_not_change_a_byte(
    meshes: Path, pristine: Path, small: BuildParameters, tmp_path: Path
) -> None:
    report = build_prior(meshes, tmp_path / "prior", small, workers=3)
    assert report.made == ["ball", "ell", "red_box"]
    assert prior_bytes(tmp_path / "prior") == prior_bytes(pristine)


def test_nothing_in_the_prior_tells_where_it_was_built(pristine: Path, meshes: Path) -> None:
    for data in prior_bytes(pristine).values():
        assert str(meshes).encode() not in data
        assert str(pristine).encode() not in data


def no_work(*_: object) -> None:
    raise AssertionError("nothing was to be made")


def test_a_second_run_makes_nothing(
    meshes: Path, prior_folder: Path, small: BuildParameters, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = {path: path.stat().st_mtime_ns for path in prior_folder.rglob("*.*")}
    monkeypatch.setattr(build, "write_shard", no_work)
    report = build_prior(meshes, prior_folder, small, workers=1)
    assert report.made == []
    assert report.kept == ["ball", "ell", "red_box"]
    after = {path: path.stat().st_mtime_ns for path in prior_folder.rglob("*.*")}
    assert {p: t for p, t in after.items() if p.name != ".lock"} == {
        p: t for p, t in before.items() if p.name != ".lock"
    }


def test_a_changed_an_added_and_a_removed_mesh(
    meshes: Path, prior_folder: Path, small: BuildParameters, tmp_path: Path
) -> None:
    changed = Path(shutil.copytree(meshes, tmp_path / "meshes"))
    trimesh.creation.box((0.2, 0.06, 0.04)).export(changed / "red_box.obj")
    trimesh.creation.icosphere(subdivisions=2, radius=0.03).export(changed / "dot.off")
    (changed / "ell.ply").unlink()
    report = build_prior(changed, prior_folder, small, workers=1)
    assert (report.made, report.kept, report.removed) == (["dot", "red_box"], ["ball"], ["ell"])
    assert verify_prior(open_prior(prior_folder)) == []
    build_prior(changed, tmp_path / "afresh", small, workers=1)
    assert prior_bytes(prior_folder) == prior_bytes(tmp_path / "afresh")


def test_a_new_description_makes_nothing_anew(
    meshes: Path, prior_folder: Path, small: BuildParameters, tmp_path: Path
) -> None:
    (tmp_path / "d.csv").write_text("ball,a tiny ball\n")
    report = build_prior(meshes, prior_folder, small, descriptions=tmp_path / "d.csv")
    assert report.made == []
    assert open_prior(prior_folder).descriptions["ball"] == "a tiny ball"


def test_other_parameters_are_refused_by_name(meshes: Path, prior_folder: Path) -> None:
    before = prior_bytes(prior_folder)
    with pytest.raises(PriorError, match="seed: 0 -> 7") as caught:
        build_prior(meshes, prior_folder, BuildParameters(seed=7))
    assert "samples: 400 -> 20000" in str(caught.value)
    assert "--overwrite" in str(caught.value)
    assert prior_bytes(prior_folder) == before


def test_bad_meshes_are_told_and_stop_nothing(
    meshes: Path, prior_folder: Path, small: BuildParameters, tmp_path: Path
) -> None:
    zoo = Path(shutil.copytree(meshes, tmp_path / "meshes"))
    trimesh.creation.box((100, 60, 40)).export(zoo / "millimetres.stl")
    (zoo / "empty.obj").write_text("")
    (zoo / "nan.obj").write_text("v nan 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n")
    (zoo / "flat.off").write_text("OFF\n3 1 0\n0 0 0\n.1 0 0\n0 .1 0\n3 0 1 2\n")
    (zoo / "junk.glb").write_bytes(b"glTF junk")
    report = build_prior(zoo, prior_folder, small, workers=2)
    assert [e.name for e in report.manifest.objects] == ["ball", "ell", "red_box"]
    reasons = {failure.name: failure.reason for failure in report.manifest.failed}
    assert sorted(reasons) == ["empty", "flat", "junk", "millimetres", "nan"]
    assert "--units mm" in reasons["millimetres"]
    assert "NaN" in reasons["nan"]
    assert all("\n" not in reason and str(zoo) not in reason for reason in reasons.values())
    assert verify_prior(open_prior(prior_folder)) == []


def test_nothing_usable_leaves_what_was_there(prior_folder: Path, tmp_path: Path) -> None:
    before = prior_bytes(prior_folder)
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "empty.obj").write_text("")
    with pytest.raises(MeshError, match=r"empty\.obj"):
        build_prior(tmp_path / "meshes", prior_folder, BuildParameters(), overwrite=True)
    assert prior_bytes(prior_folder) == before


def test_a_damaged_shard_is_made_again_to_the_same_bytes(
    meshes: Path, prior_folder: Path, small: BuildParameters
) -> None:
    before = prior_bytes(prior_folder)
    shard = next((prior_folder / "shards").iterdir())
    shard.write_bytes(shard.read_bytes()[:-100])
    (prior_folder / "shards" / ".shard-1.abc.partial.h5").write_bytes(b"left by a killed run")
    assert build_prior(meshes, prior_folder, small, workers=1).made
    assert prior_bytes(prior_folder) == before


def test_finished_shards_without_a_manifest_are_taken_over(
    meshes: Path, prior_folder: Path, small: BuildParameters, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = prior_bytes(prior_folder)
    (prior_folder / "manifest.json").unlink()
    monkeypatch.setattr(build, "write_shard", no_work)
    build_prior(meshes, prior_folder, small, workers=1)
    assert prior_bytes(prior_folder) == before


def test_a_second_builder_is_told_at_once(
    meshes: Path, prior_folder: Path, small: BuildParameters
) -> None:
    with (
        filelock.FileLock(prior_folder / ".lock"),
        pytest.raises(PriorError, match="Another build is at work"),
    ):
        build_prior(meshes, prior_folder, small)


def test_a_manifest_of_something_else_is_not_replaced(
    meshes: Path, tmp_path: Path, small: BuildParameters
) -> None:
    (tmp_path / "manifest.json").write_text('{"name": "web app"}')
    with pytest.raises(PriorError, match="not that of a prior"):
        build_prior(meshes, tmp_path, small)
    assert (tmp_path / "manifest.json").read_text() == '{"name": "web app"}'


SCRIPT = """
import sys
from pathlib import Path
from brrp_cli.errors import BrrpError
from brrp_cli.prior.build.build import build_prior
from small_prior import SMALL
if __name__ == "__main__":
    try:
        build_prior(Path(sys.argv[1]), Path(sys.argv[2]), SMALL, workers=1)
    except BrrpError as error:
        print(error)
        sys.exit(error.exit_code)
"""


FIRST = ["ad"]
NAMES = ["ad", "ae", "af", "ah"]


@pytest.fixture(scope="module")
def boxes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("boxes")
    for i, name in enumerate(NAMES):
        trimesh.creation.box((0.05 + 0.01 * i, 0.04, 0.03)).export(folder / f"{name}.ply")
    return folder


@pytest.fixture(scope="module")
def uninterrupted(boxes: Path, small: BuildParameters, tmp_path_factory) -> dict[str, bytes]:
    out = tmp_path_factory.mktemp("uninterrupted")
    build_prior(boxes, out, small, workers=1)
    return prior_bytes(out)


def hears_ctrl_c() -> None:
    """A shell lets its background processes, and theirs, ignore it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.parametrize(
    "kill",
    [
        signal.SIGKILL,
        pytest.param(signal.SIGTERM, marks=pytest.mark.slow),
        pytest.param(signal.SIGINT, marks=pytest.mark.slow),
    ],
)
def test_a_killed_build_goes_on_to_the_same_bytes(
    kill: signal.Signals,
    boxes: Path,
    uninterrupted: dict[str, bytes],
    small: BuildParameters,
    tmp_path: Path,
) -> None:
    assert plan_shards(NAMES)[0] == FIRST, "the names must fall into several shards"
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    prior = tmp_path / "prior"
    modules = [Path(brrp_cli.__file__).parents[1], Path(small_prior.__file__).parent]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, modules))}
    with subprocess.Popen(
        [sys.executable, script, boxes, prior],
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=hears_ctrl_c,
    ) as process:
        while not list(prior.glob("shards/shard-*.h5")) and process.poll() is None:
            time.sleep(0.01)
        process.send_signal(kill)
        told, _ = process.communicate()
    assert not (prior / "manifest.json").exists()
    if kill != signal.SIGKILL:
        assert process.returncode == 128 + kill
        assert "run the same command again" in told
    report = build_prior(boxes, prior, small, workers=1)
    assert set(FIRST) <= set(report.kept)
    assert prior_bytes(prior) == uninterrupted
