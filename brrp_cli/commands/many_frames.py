"""--frames: many frames of one source in one process, each into a folder of its own."""

from __future__ import annotations

import io
import re
import time
from collections.abc import Callable
from contextlib import ExitStack, redirect_stdout
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brrp_cli.commands.frames_summary import (
    SUMMARY,
    earlier_frames,
    join_poses,
    was_tracked,
    write_summary,
)
from brrp_cli.commands.frames_there import of_what_is_read, results_with
from brrp_cli.errors import BrrpError, FrameError, OutputError, ResultError, unexpected
from brrp_cli.progress import hushed, note, only_bar, say
from brrp_cli.spoken import agreed, counted

if TYPE_CHECKING:
    from brrp_cli.commands.beside import Beside
    from brrp_cli.commands.made_masks import MadeMasks
    from brrp_cli.commands.object_table import Told
    from brrp_cli.commands.source_options import SourceOptions
    from brrp_cli.frames.frame import Frame
    from brrp_cli.results.read import StoredResult

DONE, FAILED, SKIPPED = "done", "failed", "was there"


def frame_slice(ctx: click.Context, option: click.Parameter, value: str | None) -> slice | None:
    """A:B or A:B:STEP, as Python counts; any part may be left out."""
    if value is None:
        return None
    parts = value.split(":")
    try:
        if len(parts) not in (2, 3):
            raise ValueError
        numbers = [int(part) if part else None for part in parts]
        if len(numbers) == 3 and numbers[2] is not None and numbers[2] < 1:
            raise ValueError
    except ValueError:
        raise click.BadParameter(
            f"{value!r} is no range: 0:10, 5:, : (all) or 0:300:30 (every 30th);"
            " one frame is --index N",
            ctx,
            option,
        ) from None
    return slice(*numbers)


@dataclass(frozen=True)
class Work:
    """What is done to each frame.

    with_masks : (frame, its folder) -> the frame with masks, and how they were made
    one : (the frame as it was read, with masks, how, its folder, whether results that are there
        are replaced) -> what is told of its objects, once all is written
    beside : what is written beside the results, also of frames that were there
    settings : what decides the result, as result.json holds it
    track : whether the frames are those of a stream
    """

    source: SourceOptions
    with_masks: Callable[[Frame, Path], tuple[Frame, MadeMasks | None]]
    one: Callable[[Frame, Frame, MadeMasks | None, Path, bool], list[Told]]
    beside: Beside
    settings: dict[str, Any]
    overwrite: bool
    track: bool = False


def check_many(source: SourceOptions, output: Path, *, open_it: bool) -> None:
    """UsageError for options that go with one frame; OutputError for a folder of other things."""
    if source.path is None:
        raise click.UsageError("--frames chooses from a SOURCE, not from images")
    if source.index is not None:
        raise click.UsageError("--frames and --index exclude each other")
    if source.masks is not None:
        raise click.UsageError("--masks is of one frame, --frames of many")
    if open_it:
        raise click.UsageError("--view opens one page: write them with --html instead")
    if output.is_file() or (
        output.is_dir() and any(output.iterdir()) and not (output / SUMMARY).is_file()
    ):
        raise OutputError(
            "The output folder holds other things",
            where=output,
            expected=f"a folder that --frames wrote, with {SUMMARY} in it, an empty one or none",
            fix="choose another folder with -o",
        )


def folder_name(name: str) -> str:
    """The name of a frame as one of a folder."""
    return re.sub(r"[^\w.+-]+", "_", name).strip("._") or "frame"


def run_many(work: Work, frames: slice, output: Path, report: dict[str, Any]) -> bool:
    """All chosen frames, one after the other; what goes wrong with one is told and ends nothing.

    Frames that were written before with the same settings, from the same images and masks, are left
    as they are, unless all are to be overwritten. Returns whether any frame, or any object of one,
    failed. Errors: BrrpError for what concerns every frame; UsageError where none is chosen.
    """
    every = work.source.names()
    chosen = every[frames]
    if not chosen:
        raise click.UsageError(
            f"--frames chooses none of the {counted(len(every), 'frame')} of the source"
        )
    folders = _folders(chosen, output)
    there = {
        name: stored
        for name in chosen
        if not work.overwrite and (stored := results_with(folders[name], work.settings)) is not None
    }
    source = str(work.source.path)
    settings = work.settings | ({"track": True} if work.track else {})
    if there:
        _check_track(output, track=work.track)
    done, changed = of_what_is_read(there, partial(_read, work.source))
    if changed:
        several = len(changed)
        note(
            f"{counted(several, 'frame')} {agreed(several, 'was', 'were')} reconstructed from other"
            f" images or masks and {agreed(several, 'is', 'are')} done again"
        )
    if done:
        were = f"{len(done)} of {counted(len(chosen), 'frame')} {agreed(len(done), 'was', 'were')}"
        if work.track and len(done) < len(chosen):
            note(f"{were} there; a stream is done from its start")
            done = {}
        else:
            note(f"{were} there and {agreed(len(done), 'is', 'are')} left")
    earlier = earlier_frames(output, source, settings)
    told: list[dict[str, Any]] = [
        earlier.get(name, {}) | {"frame": name, "folder": folders[name].name, "status": SKIPPED}
        if name in done
        else {"frame": name, "folder": folders[name].name, "status": SKIPPED}
        for name in chosen
    ]
    report["frames"] = told
    # What earlier calls told of other frames of the source stays.
    here = {each["frame"]: each for each in told}
    summary = [here.get(name) or earlier[name] for name in every if name in here or name in earlier]
    write_summary(output, source, settings, summary)
    failed = False
    with ExitStack() as stack:
        step = stack.enter_context(only_bar(len(told) - len(done), "frames"))
        first = True
        for about in told:
            name = about["frame"]
            if name in done:
                failed |= _complete(work, about, done[name])
                continue
            failed |= _frame(work, about, folders[name], again=name in there)
            step()
            if first:  # what holds for every frame has been noted once
                stack.enter_context(hushed())
                first = False
    write_summary(output, source, settings, summary)
    join_poses(output, summary, every, work.source.path)
    count = {status: sum(a["status"] == status for a in told) for status in (DONE, FAILED, SKIPPED)}
    say(
        f"Wrote {count[DONE]} of {counted(len(chosen), 'frame')}"
        + (
            f", {count[SKIPPED]} {agreed(count[SKIPPED], 'was', 'were')} there"
            if count[SKIPPED]
            else ""
        )
        + (f", {count[FAILED]} failed" if count[FAILED] else "")
        + f": {output}/ (FRAME/ as of one frame, {SUMMARY})"
    )
    return failed


def _check_track(output: Path, *, track: bool) -> None:
    """OutputError where the frames that are there were followed and are not to be, or the other
    way round: their ids are others."""
    before = was_tracked(output)
    if before is not None and before != track:
        how = "with" if before else "without"
        raise OutputError(
            f"The frames were reconstructed {how} --track before",
            where=output,
            fix="choose another folder with -o, or pass --overwrite to do all frames again",
        )


def _complete(work: Work, about: dict[str, Any], stored: StoredResult) -> bool:
    """What is asked for beside the results of a frame that was there, and is not there yet; whether
    that failed, as where its masks were corrected since."""
    lacking = work.beside.lacking(stored)
    if not lacking:
        return False
    try:
        with redirect_stdout(io.StringIO()):
            work.beside.write(stored, lacking)
    except (FrameError, ResultError) as error:
        return _failure(about, error)
    say(f"  {about['frame']}: was there; new: {', '.join(lacking)}")
    return False


def _frame(work: Work, about: dict[str, Any], folder: Path, *, again: bool) -> bool:
    """One frame, `again` if results of it are there; whether it, or one of its objects, failed."""
    name, start = about["frame"], time.perf_counter()
    try:
        read = _read(work.source, name)
        with redirect_stdout(io.StringIO()):
            table = work.one(read, *work.with_masks(read, folder), folder, again)
    except (click.ClickException, OSError):
        raise
    except BrrpError as error:
        if not isinstance(error, FrameError):
            raise
        return _failure(about, error)
    except Exception as error:  # a library stumbled over this frame; the others may be well
        return _failure(about, unexpected(error))
    about["status"] = DONE
    about["seconds"] = round(time.perf_counter() - start, 2)
    about["objects"] = [each.record() for each in table]
    say(one_line(name, table, about["seconds"]))
    return any(each.failed for each in table)


def _read(source: SourceOptions, name: str) -> Frame:
    """A frame by its name, which formats of one frame do not take. Errors: FrameError."""
    from brrp_cli.frames.readers import format_of

    assert source.path is not None
    many = format_of(source.path).names is not None
    return replace(source, index=name if many else None).read()


def _failure(about: dict[str, Any], error: BrrpError) -> bool:
    about["status"], about["message"] = FAILED, str(error)
    say(f"  {about['frame']}: failed, {error.what}")
    click.echo(f"Error: frame {about['frame']}: {error}", err=True)
    return True


def one_line(name: str, table: list[Told], seconds: float) -> str:
    """A frame in one line: how many of its objects have a mesh, and what these were taken for."""
    made = sum(not each.failed for each in table)
    taken = [each.name for each in table if each.taken_for or each.how]
    warned = sum(bool(each.warnings) for each in table)
    line = f"  {name}: {made} of {counted(len(table), 'object')}, {seconds:.1f} s"
    line += f": {', '.join(taken)}" if taken else ""
    return line + (f" ({warned} with warnings)" if warned else "")


def _folders(names: list[str], output: Path) -> dict[str, Path]:
    """Frame -> folder. Errors: OutputError where two would have one."""
    folders = {name: output / folder_name(name) for name in names}
    first: dict[Path, str] = {}
    for name, folder in folders.items():
        other = first.setdefault(folder, name)
        if other != name:
            raise OutputError(
                "Two frames would have one folder",
                where=folder,
                found=f"{other} and {name}",
                fix="rename one of them, or choose fewer with --frames",
            )
    return folders
