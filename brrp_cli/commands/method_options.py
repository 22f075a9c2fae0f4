"""Options that the registry of methods decides: `--method`, `--preset`, and what a method needs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from brrp_cli.methods.base import Method
from brrp_cli.methods.registry import METHODS
from brrp_cli.similar_names import most_similar_name

CONFIG_HELP = "TOML with numbers that differ from the preset's; brrp config show prints them all."


class OneOf(click.ParamType):
    """One of the names that `names` gives when the value is read."""

    name = "NAME"

    def __init__(self, names: Callable[[], Sequence[str]]) -> None:
        self.names = names

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """[one|other]."""
        return f"[{'|'.join(self.names())}]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The name as it was given."""
        names = list(self.names())
        if value not in names:
            meant = most_similar_name(str(value), names)
            hint = f" Did you mean {meant!r}?" if meant else ""
            self.fail(f"{value!r} is not one of {', '.join(map(repr, names))}.{hint}", param, ctx)
        return str(value)


def methods_help(names: Sequence[str]) -> str:
    """What the methods are and what they need, for `--help`."""
    told = (f"{n}: {METHODS[n].summary}; needs {METHODS[n].needs}" for n in names)
    return ". ".join(told) + "."


def weights_help() -> str:
    """Which methods `--weights` is for."""
    trained = [name for name, method in METHODS.items() if method.uses_weights]
    return f"Trained weights of {' or '.join(trained)}. [default: those that come with brrp]"


def check_weights(methods: Sequence[str], weights: Sequence[Path]) -> None:
    """UsageError where weights are given and no method was trained; WeightsError for a file that
    cannot be used."""
    trained = [name for name in methods if METHODS[name].uses_weights]
    if weights and not trained:
        raise click.UsageError(
            f"--weights means nothing to --method {','.join(methods)}, so leave it out"
        )
    for name in trained:
        describe = METHODS[name].describe_weights
        assert describe is not None
        for path in weights:
            describe(path)


def check_options(method: Method, preset: str | None, device: str) -> None:
    """UsageError if options were typed that mean nothing to the method."""
    uses = {
        "prior_path": method.uses_prior,
        "retriever": method.uses_retriever,
        "clip_dir": method.uses_retriever,
        "k": hasattr(method.preset(), "k"),
    }
    context = click.get_current_context()
    typed = [
        option.opts[-1]
        for option in context.command.params
        if not uses.get(option.name or "", True)
        and context.get_parameter_source(option.name or "") is ParameterSource.COMMANDLINE
    ]
    if typed:
        raise click.UsageError(
            f"--method {method.name} needs {method.needs}, so leave out {', '.join(typed)}"
        )
    if preset is not None and preset not in method.presets:
        raise click.UsageError(
            f"--method {method.name} has no --preset {preset}, but {', '.join(method.presets)}"
        )
    if device == "cuda" and not method.uses_cuda:
        raise click.UsageError(f"--method {method.name} runs on the CPU alone")
