"""The command `brrp`: a group that imports a command's file only when that command is run."""

from __future__ import annotations

import importlib
import logging
import sys

import click

from brrp_cli.errors import BrrpError
from brrp_cli.stop import sigterm_raises, stopped
from brrp_cli.version import __version__

# command -> (module, one line for `brrp --help`), so that help needs no import of a command.
COMMANDS = {
    "build-prior": ("build_prior", "Turn a folder of meshes into a prior."),
    "info": ("info", "Show what a prior holds and how it was made."),
    "verify": ("verify", "Check every byte of a prior."),
    "frame": ("frame", "Turn colour and depth images into a frame; find the objects."),
    "segment": ("segment", "Make masks, show them, and correct them by id."),
    "reconstruct": ("reconstruct", "Turn an RGBD frame into a closed mesh per object."),
    "view": ("view", "Look at results in one HTML page, offline."),
    "export": ("export", "Turn results into collision shapes: URDF, MJCF, a cuRobo world."),
    "fetch": ("fetch", "Bring CLIP, or the models that make masks by a prompt."),
    "eval": ("eval", "Measure methods on scenes whose truth is known."),
    "demo": ("demo", "Run the whole path on a made scene and score it."),
}


class LazyGroup(click.Group):
    """Loads `brrp_cli.commands.NAME` when NAME is called, and tells BrrpErrors to people."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands in the order in which people meet them."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """Import the command's file."""
        if name not in COMMANDS:
            return None
        module = importlib.import_module(f"brrp_cli.commands.{COMMANDS[name][0]}")
        command: click.Command = module.command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in COMMANDS.items()])

    def invoke(self, ctx: click.Context) -> object:
        """Run; a BrrpError becomes one message on stderr and its exit code, and so does a stop."""
        try:
            with sigterm_raises():
                return super().invoke(ctx)
        except BrrpError as error:
            failure = error
        except KeyboardInterrupt as stop:
            failure = stopped(stop, found="nothing is half written")
        click.echo(f"Error: {failure}", err=True)
        sys.exit(failure.exit_code)


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="brrp")
@click.option("-q", "--quiet", is_flag=True, help="No progress bars and no notes.")
def main(quiet: bool) -> None:
    """See one RGBD image, know every object's whole shape, and how sure that is.

    \b
    Example:
      brrp build-prior meshes/ -o prior/
      brrp reconstruct frame.npz --prior prior/ -o out/
    """
    logging.basicConfig(format="%(message)s")
    logging.getLogger().setLevel(logging.ERROR if quiet else logging.INFO)


if __name__ == "__main__":
    main()
