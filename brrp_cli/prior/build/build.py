"""Build a prior from folders of meshes: only what is missing or changed, whatever fails."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from brrp_cli.errors import BrrpError, ClusterError, DependencyError, MeshError, PriorError
from brrp_cli.executors.executor import Executor, open_executor
from brrp_cli.files import atomic_path, sha256_file
from brrp_cli.prior.appearance_file import Rows, is_whole, sidecar_file, write_sidecar
from brrp_cli.prior.appearance_index import open_appearance_index
from brrp_cli.prior.build.descriptions import phrases_of
from brrp_cli.prior.build.find_meshes import MeshSource, find_all_meshes
from brrp_cli.prior.build.lock import only_builder
from brrp_cli.prior.build.make_object import make_object
from brrp_cli.prior.build.mesh_files import input_sha256
from brrp_cli.prior.build.output_folder import refuse_foreign
from brrp_cli.prior.build.reuse import Finished, Reusable, reusable_objects
from brrp_cli.prior.build.shard_plan import plan_shards, shard_file
from brrp_cli.prior.build.sweep import sweep
from brrp_cli.prior.index import index_of, write_index
from brrp_cli.prior.manifest import (
    FILE,
    Failure,
    ForeignManifestError,
    Manifest,
    ObjectEntry,
    ShardEntry,
    read_manifest,
    write_manifest,
)
from brrp_cli.prior.pack import pack
from brrp_cli.prior.parameters import BuildParameters, refuse_differences
from brrp_cli.prior.shard import StoredObject, damaged, open_shard, read_stored, write_shard
from brrp_cli.stop import sigterm_raises, stopped

# No mesh that ever gets done takes this long; pymeshlab can loop for ever on some.
TIME_LIMIT = 900.0


@dataclass(frozen=True)
class BuildReport:
    """What a build did. `made`, `kept`, `removed`: names of objects."""

    path: Path
    manifest: Manifest
    made: list[str]
    kept: list[str]
    removed: list[str]


def build_prior(
    meshes: Path | Sequence[Path],
    out: Path,
    parameters: BuildParameters | None = None,
    *,
    descriptions: Path | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    overwrite: bool = False,
    time_limit: float = TIME_LIMIT,
    progress: bool = False,
) -> BuildReport:
    """Make the prior in `out` hold the objects of the folder or folders `meshes`, and no others.

    The same meshes and parameters give the same bytes, however many workers run and however often
    the build was interrupted. Errors: MeshError when there are no meshes or all of them fail;
    PriorError when the prior there has other parameters (and not `overwrite`) or another build is
    at work on it; StoppedError after Ctrl-C or SIGTERM, which keeps what is finished; OutputError,
    also for a folder of other files; those of `open_executor`, to which `workers` and `scheduler`
    go; BrrpError where worker processes do not start.
    """
    refuse_foreign(out)
    table = (parameters or BuildParameters()).as_dict()
    places = [meshes] if isinstance(meshes, Path) else list(meshes)
    sources = {source.name: source for source in find_all_meshes(places)}
    phrases = phrases_of(sources, descriptions)
    with sole_builder(out):
        before = previous_manifest(out)
        if before is not None and not overwrite:
            refuse_differences(before.parameters, table, out)
        run = Run(out, table, sources, reusable_objects(out, before, table))
        with open_executor(workers, scheduler) as executor:
            run.hash_inputs()
            run.make(parameters or BuildParameters(), executor, time_limit, progress, reads=places)
        if not run.done:
            raise MeshError(
                "None of the meshes became an object",
                where=" and ".join(map(str, places)),
                found="\n".join(f"{f.source}: {f.reason}" for f in run.failures()),
            )
        return run.commit(phrases, before)


GO_ON = "run the same command again to go on"


@contextmanager
def sole_builder(out: Path) -> Iterator[None]:
    """Hold the prior's lock. Ctrl-C or SIGTERM becomes a StoppedError, wherever it came."""
    try:
        with sigterm_raises(), only_builder(out):
            yield
    except KeyboardInterrupt as stop:
        raise stopped(stop, where=out, found="what was finished is kept", fix=GO_ON) from None


@dataclass
class Run:
    """What is known while a build goes on, by name of object.

    old : entries of objects that stay without a mesh being read; known : shards of theirs, whose
    sums need not be taken again; rows : their appearance;
    failed_before : failures that stay told
    """

    out: Path
    parameters: dict[str, Any]
    sources: dict[str, MeshSource]
    stock: Reusable
    old: dict[str, ObjectEntry] = field(default_factory=dict)
    known: dict[str, ShardEntry] = field(default_factory=dict)
    rows: Rows = field(default_factory=dict)
    failed_before: dict[str, Failure] = field(default_factory=dict)
    hashes: dict[str, str] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    made: dict[str, None] = field(default_factory=dict)
    waiting: dict[str, StoredObject] = field(default_factory=dict)
    done: dict[str, Finished] = field(default_factory=dict)

    def hash_inputs(self) -> None:
        """sha256 of what each object is made from; what cannot be read has failed."""
        for name, source in self.sources.items():
            try:
                self.hashes[name] = input_sha256(source.path)
            except OSError as error:
                self.failed[name] = f"The mesh file cannot be read: {error.strerror}"
            except MeshError as error:
                self.failed[name] = _reason(error, source)

    def make(
        self,
        parameters: BuildParameters,
        executor: Executor,
        time_limit: float = TIME_LIMIT,
        progress: bool = False,
        *,
        reads: Sequence[Path] = (),
    ) -> None:
        """Make what is not in stock; write each shard when the last of its members is there.

        reads : files and folders of the meshes
        """
        from tqdm import tqdm

        groups = plan_shards(list(self.hashes))
        group_of = {name: group for group in groups for name in group}
        todo = [n for group in groups for n in group if (n, self.hashes[n]) not in self.stock]
        left = {id(group): len(set(group) & set(todo)) for group in groups}
        for group in groups:
            if not left[id(group)]:
                self._write(group)
        tasks = [(self.sources[name], self.hashes[name], parameters) for name in todo]
        results = executor.run(make_stored, tasks, time_limit, reads=reads)
        try:
            for index, result in tqdm(
                results, total=len(todo), desc="objects", disable=not progress or not todo
            ):
                self._take(todo[index], result)
                group = group_of[todo[index]]
                left[id(group)] -= 1
                if not left[id(group)]:
                    self._write(group)
        except (KeyboardInterrupt, ClusterError) as stop:
            for group in groups:
                if self.waiting.keys() & set(group):
                    self._write(group)
            if isinstance(stop, ClusterError):
                raise
            raise stopped(
                stop,
                where=self.out,
                found=f"{len(self.made)} of {len(todo)} objects made in this run; they are kept",
                fix=GO_ON,
            ) from None
        finally:
            results.close()

    def _take(self, name: str, result: StoredObject | BrrpError) -> None:
        if isinstance(result, DependencyError):
            raise result
        if isinstance(result, BrrpError):
            self.failed[name] = _reason(result, self.sources[name])
        else:
            self.waiting[name] = result
            self.made[name] = None

    def _write(self, group: list[str]) -> None:
        """Write the shard of those members that are there, unless it stands already."""
        here = [
            (name, self.hashes[name])
            for name in group
            if name in self.waiting or (name, self.hashes[name]) in self.stock
        ]
        if not here:
            return
        file = shard_file(self.parameters, here)
        origins = {
            (None, "") if name in self.waiting else self.stock[name, sha].place
            for name, sha in here
        }
        if origins == {(None, file)}:
            records = [self.stock[key].record for key in here]
        elif whole := _only(origins, file):
            self._copy(whole, file)
            records = [self.stock[key].record for key in here]
        else:
            self.known.pop(file, None)
            objects = [self._stored(name, sha) for name, sha in here]
            write_shard(self.out / file, objects, self.parameters)
            records = [stored.record for stored in objects]
            # Not before: Ctrl-C in the middle of writing must lose none of them.
            for name, _ in here:
                self.waiting.pop(name, None)
        for (name, _), record in zip(here, records, strict=True):
            self.done[name] = Finished(file, record)

    def _copy(self, folder: Path, file: str) -> None:
        """Take over a whole shard of another prior."""
        with atomic_path(self.out / file) as partial:
            shutil.copyfile(folder / file, partial)
            if sha256_file(partial) != self.known[file].sha256:
                raise damaged(folder / file, "bytes that do not have the manifest's sha256")

    def _stored(self, name: str, sha256: str) -> StoredObject:
        if name in self.waiting:
            return self.waiting[name]
        finished = self.stock[name, sha256]
        with open_shard((finished.folder or self.out) / finished.shard) as shard:
            stored = read_stored(shard, name)
        if stored.input_sha256 != sha256 or stored.record != finished.record:
            raise damaged(f"{finished.shard}, {name}", "not what the manifest tells of it")
        return stored

    def failures(self) -> list[Failure]:
        """The meshes that did not become objects."""
        failed = {name: f for name, f in self.failed_before.items() if name not in self.done}
        for name, reason in self.failed.items():
            failed[name] = Failure(name, self.sources[name].relative, reason)
        return [failed[name] for name in sorted(failed)]

    def commit(self, phrases: dict[str, str], before: Manifest | None) -> BuildReport:
        """Write the manifest of all that stands now, and delete what is no longer needed."""
        manifest = self._manifest(phrases, before)
        index = index_of(manifest, write_manifest(self.out, manifest))
        # Now, so that not the first to open the prior pays for it.
        write_index(self.out, index)
        open_appearance_index(self.out, index, lambda: manifest)
        sweep(self.out, manifest)
        names = {entry.name for entry in manifest.objects}
        return BuildReport(
            path=self.out,
            manifest=manifest,
            made=sorted(self.made),
            kept=sorted(names - set(self.made)),
            removed=sorted({e.name for e in before.objects} - names if before else ()),
        )

    def _manifest(self, phrases: dict[str, str], before: Manifest | None) -> Manifest:
        files = sorted({finished.shard for finished in self.done.values()})
        objects = [self._entry(name, phrases) for name in sorted(self.done)]
        return Manifest(
            parameters=self.parameters,
            objects=objects,
            shards=[self.known.get(file) or _shard_entry(self.out, file) for file in files],
            failed=self.failures(),
            appearance=self._sidecar(objects, before),
        )

    def _entry(self, name: str, phrases: dict[str, str]) -> ObjectEntry:
        finished = self.done[name]
        if name in self.old and name not in self.sources:
            return replace(self.old[name], shard=finished.shard)
        return ObjectEntry(
            name=name,
            description=phrases[name],
            source=self.sources[name].relative,
            input_sha256=self.hashes[name],
            shard=finished.shard,
            record=finished.record,
        )

    def _sidecar(self, objects: list[ObjectEntry], before: Manifest | None) -> ShardEntry:
        """The file of all objects' appearance, which is written unless it stands already."""
        entry = before.appearance if before is not None else None
        file = sidecar_file(objects, self.parameters)
        if entry is None or entry.file != file or not is_whole(self.out, entry):
            entry = write_sidecar(self.out, objects, self.parameters, self.rows)
        return entry


def _only(origins: set[tuple[Path | None, str]], file: str) -> Path | None:
    """The other prior whose shard `file` holds all of the members, if there is one."""
    return next((folder for folder, _ in origins if origins == {(folder, file)}), None)


def _shard_entry(folder: Path, file: str) -> ShardEntry:
    return ShardEntry(file, sha256_file(folder / file), (folder / file).stat().st_size)


def make_stored(source: MeshSource, sha256: str, parameters: BuildParameters) -> StoredObject:
    """A worker's task: one mesh, as its shard holds it. Errors: MeshError."""
    made = pack(make_object(source, parameters), sha256)
    if input_sha256(source.path) != sha256:
        raise MeshError(
            "The mesh changed while the prior was built",
            where=source.path,
            fix="run brrp build-prior again",
        )
    return made


def _reason(error: BrrpError, source: MeshSource) -> str:
    parts = [error.what, error.found, error.fix]
    line = "; ".join(" ".join(str(part).split()) for part in parts if part)
    # The manifest is the same wherever the meshes lie.
    return line.replace(str(source.path), source.relative)


def previous_manifest(out: Path) -> Manifest | None:
    """The manifest that stands there, if one does that can be used. Errors: PriorError for one that
    is not ours to replace."""
    if not (out / FILE).is_file():
        return None
    try:
        return read_manifest(out)
    except ForeignManifestError:
        raise
    except PriorError:
        return None
