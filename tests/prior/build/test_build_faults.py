"""The builder, killed or failed at every step that it takes on the disk.

Meshes are made into objects once, by the builder's own code; what is under test is what becomes of
files, so that each case takes a twentieth of a second.
"""

from __future__ import annotations

import errno
import os
import resource
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import trimesh
from file_faults import (
    CREATE,
    DELETE,
    FOLDER,
    FSYNC,
    RENAME,
    WRITE,
    Steps,
    fail_at,
    in_a_process,
    kill_at,
    watched,
)
from small_prior import prior_bytes

from brrp_cli.config import FeatureConfig
from brrp_cli.errors import BrrpError, OutputError
from brrp_cli.executors.processes import Processes
from brrp_cli.prior.build.build import build_prior, make_stored
from brrp_cli.prior.build.shard_plan import plan_shards
from brrp_cli.prior.manifest import FILE
from brrp_cli.prior.parameters import AppearanceConfig, BuildParameters, FieldConfig
from brrp_cli.prior.store import open_prior, verify_prior

TINY = BuildParameters(
    samples=60,
    surface_points=30,
    dense_points=300,
    features=FeatureConfig(scales=(0.5,), voxel=0.02),
    appearance=AppearanceConfig(views=2, rays=60),
    distances=FieldConfig(nodes=60),
)
NAMES = ["ad", "ae", "af", "ah"]


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Meshes as they were, and as they are later: one changed, one gone, one new."""
    folder = tmp_path_factory.mktemp("sources")
    before, after = folder / "before", folder / "after"
    before.mkdir()
    for i, name in enumerate(NAMES):
        trimesh.creation.box((0.05 + 0.01 * i, 0.04, 0.03)).export(before / f"{name}.ply")
    (before / "bad.obj").write_text("v 0 0 0\n")
    shutil.copytree(before, after)
    trimesh.creation.box((0.2, 0.06, 0.04)).export(after / "ae.ply")
    trimesh.creation.icosphere(subdivisions=1, radius=0.03).export(after / "dot.off")
    (after / "ah.ply").unlink()
    return before, after


@pytest.fixture(scope="module", autouse=True)
def made_once() -> Any:
    """Each mesh is made into an object once, in this process, for all cases."""
    known: dict[tuple[str, str], Any] = {}

    def at_hand(
        self: Processes,
        function: Callable[..., Any],
        tasks: list[tuple[Any, ...]],
        limit: float,
        **shared: object,
    ) -> Any:
        assert function is make_stored
        for index, (source, sha256, parameters) in enumerate(tasks):
            if (source.name, sha256) not in known:
                try:
                    known[source.name, sha256] = make_stored(source, sha256, parameters)
                except BrrpError as error:
                    known[source.name, sha256] = error
            yield index, known[source.name, sha256]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Processes, "run", at_hand)
        yield


@pytest.fixture(scope="module")
def whole(sources: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Uninterrupted builds of both states."""
    assert len(plan_shards(NAMES)) > 1, "the names must fall into several shards"
    folder = tmp_path_factory.mktemp("whole")
    for name, source in zip("ab", sources, strict=True):
        build_prior(source, folder / name, TINY, workers=1)
    return [folder / "a", folder / "b"]


def steps_of(source: Path, out: Path, **options: Any) -> Steps:
    """What a build that nobody disturbs does to the files of `out`."""
    with watched(Steps(out, **options)) as steps:
        build_prior(source, out, TINY, workers=1)
    return steps


def started(out: Path, whole: list[Path], *, over: bool) -> Path:
    """The folder before the build under test: none, or the first prior."""
    shutil.rmtree(out, ignore_errors=True)
    if over:
        shutil.copytree(whole[0], out)
    return out


def usable(out: Path, whole: list[Path]) -> None:
    """A reader finds the prior that was there, or the new one, and can read all of it."""
    prior = open_prior(out)
    (same,) = [w for w in whole if (w / FILE).read_bytes() == (out / FILE).read_bytes()]
    reference = open_prior(same)
    assert prior.digest == reference.digest
    for name in prior.names:
        assert (prior.load(name).samples == reference.load(name).samples).all()
    assert all("does not list" in line for line in verify_prior(prior))


# Of every third step in the suite, of every step and of writes a quarter as long on demand.
EVERY = pytest.mark.parametrize(
    ("every", "chunk"), [(3, 16384), pytest.param(1, 4096, marks=pytest.mark.long)]
)
OVER = pytest.mark.parametrize(
    "over", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["new", "over another"]
)


@OVER
@EVERY
def test_a_build_killed_at_any_step_is_resumed_to_the_same_bytes(
    every: int,
    chunk: int,
    over: bool,
    sources: tuple[Path, Path],
    whole: list[Path],
    tmp_path: Path,
) -> None:
    source, wanted = sources[over], prior_bytes(whole[over])
    out = tmp_path / "prior"
    steps = steps_of(source, started(out, whole, over=over), chunk=chunk)
    assert prior_bytes(out) == wanted
    assert steps.count(WRITE) >= 10 and steps.count(RENAME) >= 6
    for number in range(over, len(steps.done), every):
        started(out, whole, over=over)

        def work(number: int = number) -> None:
            with watched(Steps(out, kill_at(number), chunk)):
                build_prior(source, out, TINY, workers=1)

        assert in_a_process(work) == -signal.SIGKILL
        if over:
            usable(out, whole)
        build_prior(source, out, TINY, workers=1)
        assert prior_bytes(out) == wanted, steps.done[number]


@OVER
@EVERY
def test_a_step_that_fails_is_one_message_and_the_build_goes_on_later(
    every: int,
    chunk: int,
    over: bool,
    sources: tuple[Path, Path],
    whole: list[Path],
    tmp_path: Path,
) -> None:
    source, wanted = sources[over], prior_bytes(whole[over])
    out = tmp_path / "prior"
    steps = steps_of(source, started(out, whole, over=over), chunk=chunk)
    refused = 0
    for number in range(over, len(steps.done), every):
        kind, path = steps.done[number]
        started(out, whole, over=over)
        code = errno.ENOSPC if number % 2 else errno.EIO
        try:
            with watched(Steps(out, fail_at(number, code), chunk)):
                build_prior(source, out, TINY, workers=1)
        except OutputError as error:
            refused += 1
            assert os.strerror(code) in str(error) and str(out) in str(error)
        else:
            # Only what costs nothing but time may fail in silence.
            assert kind == DELETE or "index" in path or ".npz" in path or str(out) == path
            open_prior(out)
        if kind not in (DELETE, FOLDER):
            assert not [p for p in out.rglob("*") if ".partial" in p.name], path
        if over:
            usable(out, whole)
        build_prior(source, out, TINY, workers=1)
        assert prior_bytes(out) == wanted, (kind, path)
    assert refused > len(steps.done) / every / 2


def test_every_rename_comes_after_an_fsync_and_the_manifest_after_its_shards(
    sources: tuple[Path, Path], tmp_path: Path
) -> None:
    """What a power cut may lose is no part of a prior that is told of."""
    out = tmp_path / "prior"
    with watched(Steps(out)) as steps:
        build_prior(sources[0], out, TINY, workers=1)
    files = [(kind, Path(path)) for kind, path in steps.done]
    commit = files.index((RENAME, out / FILE))
    for number, (kind, path) in enumerate(files):
        if kind != RENAME:
            continue
        assert files[number - 1][0] == FSYNC and files[number - 1][1].name.startswith(".")
        assert files[number + 1] == (FSYNC, path.parent)
        if path.suffix == ".h5" or path.name.endswith(".npy"):
            assert number < commit
    assert not [kind for kind, _ in files[:commit] if kind == DELETE]
    assert {kind for kind, _ in files} >= {CREATE, FOLDER}


def test_a_limit_on_the_size_of_files_is_told_and_removed(
    sources: tuple[Path, Path], whole: list[Path], tmp_path: Path
) -> None:
    """The kernel itself refuses the write; at each limit another file is the first to be hit."""
    largest = max(len(data) for data in prior_bytes(whole[0]).values())
    limits = [int(largest * share) for share in (0.01, 0.05, 0.2, 0.4, 0.6, 0.8, 0.9, 0.97)]
    for number, limit in enumerate(limits):
        out = tmp_path / f"prior{number}"

        def work(out: Path = out, limit: int = limit) -> None:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
            with pytest.raises(OutputError, match="File too large"):
                build_prior(sources[0], out, TINY, workers=1)
            assert not list(out.rglob("*.partial*"))

        assert in_a_process(work) == 0
        build_prior(sources[0], out, TINY, workers=1)
        assert prior_bytes(out) == prior_bytes(whole[0])


def small_disk(folder: Path, kilobytes: int) -> bool:
    """Mount a file system of that size there, for this process alone; whether that is allowed."""
    import ctypes

    libc = ctypes.CDLL(None, use_errno=True)
    user, mount = 0x10000000, 0x00020000
    uid, gid = os.getuid(), os.getgid()
    if libc.unshare(user | mount) != 0:
        return False
    try:
        Path("/proc/self/setgroups").write_text("deny")
        Path("/proc/self/uid_map").write_text(f"0 {uid} 1")
        Path("/proc/self/gid_map").write_text(f"0 {gid} 1")
    except OSError:
        return False
    options = f"size={kilobytes}k".encode()
    return libc.mount(b"none", os.fsencode(folder), b"tmpfs", 0, options) == 0


def test_a_full_disk_is_told_and_leaves_no_rest(sources: tuple[Path, Path], tmp_path: Path) -> None:
    """A real one: a file system in memory, from too small for one shard to too small for the last
    file."""
    disk = tmp_path / "disk"
    disk.mkdir()
    told = tmp_path / "told"

    def work(kilobytes: int) -> None:
        if not small_disk(disk, kilobytes):
            told.write_text("no mount")
            return
        try:
            build_prior(sources[0], disk / "prior", TINY, workers=1)
            told.write_text("built")
        except OutputError as error:
            rest = [p.name for p in disk.rglob("*.partial*")]
            there = (disk / "prior" / FILE).exists()
            told.write_text(f"{error.found} {rest} {there}")

    for kilobytes in (64, 100, 160, 200, 260):
        assert in_a_process(lambda size=kilobytes: work(size)) == 0
        if told.read_text() == "no mount":
            pytest.skip("mounting is not allowed here")
        assert told.read_text() == "No space left on device [] False", kilobytes
    assert in_a_process(lambda: work(10_000)) == 0
    assert told.read_text() == "built"
