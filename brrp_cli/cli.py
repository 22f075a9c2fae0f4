"""The command `brrp`: a group that imports a command's file only when that command is run."""

from __future__ import annotations

import gc
import importlib
import logging
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager

import click

from brrp_cli.errors import BrrpError, unexpected
from brrp_cli.memory import one_heap
from brrp_cli.similar_names import most_similar_name
from brrp_cli.spoken import command_line
from brrp_cli.stop import sigterm_raises, stopped
from brrp_cli.version import __version__

# command -> (module, one line for `brrp --help`), so that help needs no import of a command.
COMMANDS = {
    "build-prior": ("build_prior", "Turn folders of meshes into a prior."),
    "prior": ("prior", "Add objects to a prior, remove, merge, list, show them."),
    "info": ("info", "Show what a prior holds and how it was made."),
    "verify": ("verify", "Check every byte of a prior."),
    "frame": ("frame", "Turn colour and depth images into a frame; find the objects."),
    "segment": ("segment", "Make masks, show them, and correct them by id."),
    "reconstruct": ("reconstruct", "Turn an RGBD frame into a closed mesh per object."),
    "view": ("view", "Look at results in one HTML page, offline."),
    "export": ("export", "Turn results into collision shapes: URDF, MJCF, a cuRobo world."),
    "grasp": ("grasp", "Plan grasps of every object, ranked by how probably they hold."),
    "config": ("config", "Show every number that decides a result."),
    "fetch": ("fetch", "Bring CLIP, models that make masks, or meshes."),
    "eval": ("eval", "Measure methods on scenes whose truth is known."),
    "demo": ("demo", "Run the whole path on a made scene and score it."),
}


VOLUME = "brrp_cli.volume"  # key of a context's meta: what of --quiet and --verbose was typed


def _volume(ctx: click.Context, option: click.Parameter, given: bool) -> None:
    """Take -q or -v, from before the command's name or from after it."""
    chosen: set[str] = ctx.meta.setdefault(VOLUME, set())
    if given:
        chosen.add(str(option.name))
    if len(chosen) > 1:
        raise click.UsageError("--quiet and --verbose exclude each other", ctx)
    verbose = "verbose" in chosen
    logging.basicConfig()
    for handler in logging.getLogger().handlers:
        if type(handler) is not logging.StreamHandler:
            continue  # somebody else's
        text = "%(levelname)s %(name)s: %(message)s" if verbose else "%(message)s"
        handler.setFormatter(logging.Formatter(text))
    logging.getLogger().setLevel(logging.ERROR if "quiet" in chosen else logging.INFO)
    # Other libraries' debugging would drown it.
    logging.getLogger("brrp_cli").setLevel(logging.DEBUG if verbose else logging.NOTSET)


def volume_options() -> list[click.Option]:
    """-q and -v, which every command takes."""
    told = {
        "quiet": "No progress bars and no notes.",
        "verbose": "Show the log, and the traceback of an unexpected error.",
    }
    return [
        click.Option(
            [f"-{name[0]}", f"--{name}"],
            is_flag=True,
            expose_value=False,
            callback=_volume,
            help=text,
        )
        for name, text in told.items()
    ]


def with_volume(command: click.Command) -> click.Command:
    """The command, and those below it, with -q and -v."""
    if "verbose" not in {option.name for option in command.params}:
        command.params += volume_options()
        for inner in command.commands.values() if isinstance(command, click.Group) else ():
            with_volume(inner)
    return command


# New objects between two searches for garbage, and how many of these make a wider one.
_GARBAGE = (100_000, 50, 50)


@contextmanager
def _seldom_collected() -> Iterator[None]:
    """Importing libraries makes a million objects that stay: to search them for garbage again and
    again, as is usual, takes a tenth of a command's time."""
    before = gc.get_threshold()
    gc.set_threshold(*_GARBAGE)
    try:
        yield
    finally:
        gc.set_threshold(*before)


class LazyGroup(click.Group):
    """Loads `brrp_cli.commands.NAME` when NAME is called, and tells errors to people."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands in the order in which people meet them."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """Import the command's file."""
        if name not in COMMANDS:
            return None
        module = importlib.import_module(f"brrp_cli.commands.{COMMANDS[name][0]}")
        command: click.Command = module.command
        return with_volume(command)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that was typed; one that is not there is told with the one most like it."""
        meant = None if args[0] in COMMANDS else most_similar_name(args[0], COMMANDS)
        if meant is not None and self.get_command(ctx, args[0]) is None:
            ctx.fail(f"No such command {args[0]!r}. Did you mean {meant!r}?")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in COMMANDS.items()])

    def invoke(self, ctx: click.Context) -> object:
        """Run; an error becomes one message on stderr and its exit code, and so does a stop."""
        one_heap()
        try:
            with sigterm_raises(), command_line(), _seldom_collected():
                return super().invoke(ctx)
        except BrrpError as error:
            failure = error
        except KeyboardInterrupt as stop:
            failure = stopped(stop, found="nothing is half written")
        except (click.ClickException, click.exceptions.Exit, click.Abort, BrokenPipeError):
            raise
        except Exception as error:
            if "verbose" in ctx.meta.get(VOLUME, ()):
                click.echo(traceback.format_exc(), err=True)
            failure = unexpected(error)
        click.echo(f"Error: {failure}", err=True)
        sys.exit(failure.exit_code)


@click.group(
    cls=LazyGroup,
    params=volume_options(),
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(__version__, "-V", "--version", prog_name="brrp")
def main() -> None:
    """See one RGBD image, know every object's whole shape, and how sure that is.

    \b
    Example:
      brrp build-prior meshes/ -o prior/
      brrp reconstruct frame.npz --prior prior/ -o out/
    """


if __name__ == "__main__":
    main()
