"""Add objects to a prior, remove them, merge priors: what stays is taken over as it lies there.

The result has the bytes that a build of all the meshes together would have. It is committed as a
build is: under the prior's lock, shards first, the manifest last.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from brrp_cli.errors import MeshError, PriorError
from brrp_cli.executors.processes import Processes
from brrp_cli.prior.appearance_file import kept_rows
from brrp_cli.prior.build.build import (
    TIME_LIMIT,
    BuildReport,
    Run,
    previous_manifest,
    sole_builder,
)
from brrp_cli.prior.build.descriptions import phrases_of
from brrp_cli.prior.build.find_meshes import find_all_meshes
from brrp_cli.prior.build.reuse import Finished, Reusable, unlisted_objects
from brrp_cli.prior.manifest import FILE, Failure, Manifest, ObjectEntry, read_bytes, read_manifest
from brrp_cli.prior.names import unknown_object
from brrp_cli.prior.parameters import differences, restore_parameters
from brrp_cli.prior.shard import damaged
from brrp_cli.threads import cores


@dataclass(frozen=True)
class EditReport(BuildReport):
    """What an edit did, beside what a build does.

    failed : of the meshes that were given; the manifest tells of earlier ones as well
    forgotten : names of meshes that failed before and of which nothing is told any more
    """

    failed: list[Failure] = field(default_factory=list)
    forgotten: list[str] = field(default_factory=list)


def add_objects(
    prior: Path,
    meshes: Sequence[Path],
    *,
    descriptions: Path | None = None,
    replace: bool = False,
    workers: int | None = None,
    time_limit: float = TIME_LIMIT,
    progress: bool = False,
) -> EditReport:
    """Add the objects of folders, or single files, to a prior, made with the prior's parameters.

    An object that is there already, of the same mesh, is kept. Errors: PriorError for one of
    another mesh, unless `replace`; else those of build_prior.
    """
    sources = {source.name: source for source in find_all_meshes(meshes)}
    phrases = phrases_of(sources, descriptions)
    # No folder is made, and no lock, where there is no prior.
    read_bytes(prior)
    with sole_builder(prior):
        before = read_manifest(prior)
        parameters = restore_parameters(before.parameters, prior / FILE)
        run = _run(prior, before, before.objects)
        run.sources = sources
        run.hash_inputs()
        _refuse_others(run, prior, replace=replace)
        # What cannot be read, or fails, leaves the object of its name as it was.
        run.hashes = {entry.name: entry.input_sha256 for entry in before.objects} | run.hashes
        listed = {shard.file for shard in before.shards}
        for key, finished in unlisted_objects(prior, listed, before.parameters).items():
            run.stock.setdefault(key, finished)
        run.make(parameters, Processes(workers or cores()), time_limit, progress)
        report = run.commit(phrases, before)
        failed = [failure for failure in report.manifest.failed if failure.name in sources]
        return EditReport(**vars(report), failed=failed)


def remove_objects(prior: Path, names: Iterable[str]) -> EditReport:
    """Remove objects by name; a mesh that failed is told no more. Errors: PriorError for a name
    that is not there, or where none would be left; OutputError."""
    read_bytes(prior)
    with sole_builder(prior):
        before = read_manifest(prior)
        gone = set(names)
        known = {entry.name for entry in before.objects} | {f.name for f in before.failed}
        for name in sorted(gone - known):
            raise unknown_object(name, known, prior)
        kept = [entry for entry in before.objects if entry.name not in gone]
        if not kept:
            raise PriorError(
                "A prior without objects is none", where=prior, fix="delete its folder instead"
            )
        run = _run(prior, before, kept)
        forgotten = sorted(gone & run.failed_before.keys())
        for name in forgotten:
            del run.failed_before[name]
        run.make(restore_parameters(before.parameters, prior / FILE), Processes(1))
        return EditReport(**vars(run.commit({}, before)), forgotten=forgotten)


def merge_priors(priors: Sequence[Path], out: Path, *, overwrite: bool = False) -> BuildReport:
    """Make the prior in `out`, which may be one of `priors`, hold the objects of all of them.

    Of an object that several hold, the first is taken. Errors: PriorError for priors of different
    parameters, for one name with several meshes, or for another prior in `out` (and not
    `overwrite`); OutputError.
    """
    folders = list({prior.resolve(): prior for prior in priors}.values())
    with sole_builder(out):
        manifests = {folder: read_manifest(folder) for folder in folders}
        same = next((folder for folder in folders if folder.resolve() == out.resolve()), None)
        before = manifests[same] if same is not None else previous_manifest(out)
        if before is not None and same is None and not overwrite:
            raise PriorError(
                "Another prior is there",
                where=out,
                fix="pass --overwrite to replace it, name it among the priors to merge, or choose "
                "another folder with -o",
            )
        _refuse_unlike(manifests)
        first = next(iter(manifests.values()))
        run = Run(out, first.parameters, {}, {})
        for folder, manifest in manifests.items():
            _refuse_missing_shards(folder, manifest)
            own = None if folder is same else folder
            for key, finished in _stock(manifest, own).items():
                # What lies here already need not be copied.
                if own is None:
                    run.stock[key] = finished
                else:
                    run.stock.setdefault(key, finished)
            for entry in manifest.objects:
                run.old.setdefault(entry.name, entry)
            run.known |= {shard.file: shard for shard in manifest.shards}
            run.rows = kept_rows(folder, manifest) | run.rows
            run.failed_before = {f.name: f for f in manifest.failed} | run.failed_before
        run.hashes = {name: entry.input_sha256 for name, entry in run.old.items()}
        listed = {shard.file for shard in before.shards} if before is not None else set()
        for key, finished in unlisted_objects(out, listed, first.parameters).items():
            if key in run.stock and run.stock[key].record == finished.record:
                run.stock[key] = finished
        run.make(restore_parameters(first.parameters, folders[0] / FILE), Processes(1))
        return run.commit({}, before)


def _run(prior: Path, before: Manifest, kept: Sequence[ObjectEntry]) -> Run:
    """A run in which the objects `kept` stay without being looked at."""
    _refuse_missing_shards(prior, before)
    return Run(
        prior,
        before.parameters,
        {},
        _stock(before, None),
        old={entry.name: entry for entry in kept},
        known={shard.file: shard for shard in before.shards},
        rows=kept_rows(prior, before),
        failed_before={failure.name: failure for failure in before.failed},
        hashes={entry.name: entry.input_sha256 for entry in kept},
    )


def _stock(manifest: Manifest, folder: Path | None) -> Reusable:
    return {
        (entry.name, entry.input_sha256): Finished(entry.shard, entry.record, folder)
        for entry in manifest.objects
    }


def _refuse_missing_shards(folder: Path, manifest: Manifest) -> None:
    """PriorError for a shard that is gone or cut. The bytes of those that change are checked as
    they are read, object by object; `brrp verify` checks all of them."""
    for shard in manifest.shards:
        path = folder / shard.file
        size = path.stat().st_size if path.is_file() else 0
        if size != shard.bytes:
            raise damaged(path, f"{size} bytes in place of {shard.bytes}")


def _refuse_others(run: Run, prior: Path, *, replace: bool) -> None:
    """PriorError for objects of names that the prior has for others."""
    by_case = {name.casefold(): name for name in run.old}
    for name in run.sources:
        there = by_case.get(name.casefold(), name)
        if there != name:
            raise MeshError(
                "The prior has an object whose name differs in case alone",
                where=prior,
                found=f"{there} and {name}",
                fix="rename the mesh, or remove the object: brrp prior remove " + there,
            )
    clashes = sorted(
        name
        for name, sha256 in run.hashes.items()
        if name in run.sources and name in run.old and run.old[name].input_sha256 != sha256
    )
    if clashes and not replace:
        raise PriorError(
            "The prior has objects of these names, of other meshes",
            where=prior,
            found=", ".join(clashes[:5]) + (" ..." if len(clashes) > 5 else ""),
            fix="pass --replace to take the new meshes, or rename them",
        )


def _refuse_unlike(manifests: dict[Path, Manifest]) -> None:
    """PriorError unless the priors have one set of parameters, and one mesh for each name."""
    (first, manifest), *others = manifests.items()
    met = {entry.name.casefold(): (entry, first) for entry in manifest.objects}
    for folder, other in others:
        lines = differences(manifest.parameters, other.parameters)
        if lines:
            raise PriorError(
                "The priors were built with different parameters",
                where=f"{first} and {folder}",
                found="; ".join(lines),
                fix="build one of them again with the parameters of the other",
            )
        for entry in other.objects:
            there, where = met.setdefault(entry.name.casefold(), (entry, folder))
            if (there.name, there.input_sha256) != (entry.name, entry.input_sha256):
                raise PriorError(
                    "Two priors have different objects of one name",
                    where=f"{where} and {folder}",
                    found=f"{there.name} and {entry.name}",
                    fix="remove one of them first: brrp prior remove " + entry.name,
                )
