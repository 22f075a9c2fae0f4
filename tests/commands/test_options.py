"""Options are spelled alike in every command and say what they do; errors wait for no library."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from collections.abc import Iterator

import click
import pytest

from brrp_cli.cli import COMMANDS, main

# Each takes longer to import than an error may take.
HEAVY = {"torch", "open3d", "onnxruntime", "pymeshlab", "skimage", "matplotlib", "trimesh", "scipy"}
SECONDS = 0.5  # of one core; what a busy machine takes beside it is not counted


def leaves(
    command: click.Command, name: str, ctx: click.Context
) -> Iterator[tuple[str, click.Command]]:
    if isinstance(command, click.Group):
        for each in command.list_commands(ctx):
            inner = command.get_command(ctx, each)
            assert inner is not None
            yield from leaves(inner, f"{name} {each}".strip(), ctx)
    else:
        yield name, command


EVERY = dict(leaves(main, "", click.Context(main)))
SEVERAL = [(name, p) for name, c in EVERY.items() for p in c.params if isinstance(p, click.Option)]


def test_all_commands_are_here():
    assert {name.split()[0] for name in EVERY} == set(COMMANDS)


@pytest.mark.parametrize(
    ("name", "option"), SEVERAL, ids=[f"{name} {option.opts[-1]}" for name, option in SEVERAL]
)
def test_an_option_has_help_and_one_spelling(name, option):
    told = (option.help or "").split("[default")[0]
    assert len(told) > 5, f"{name} {option.opts} says nothing of itself"
    assert "--out" not in option.opts
    for short, long in {"-o": "--output", "-q": "--quiet", "-v": "--verbose"}.items():
        assert (short in option.opts) == (long in option.opts)


# Something that is not there, or a word that means nothing, for each command.
WRONG = {
    "build-prior": ["nowhere", "-o", "p"],
    "prior list": ["--prior", "nowhere"],
    "info": ["nowhere"],
    "verify": ["nowhere"],
    "frame": ["nowhere", "-o", "f.npz"],
    "segment": ["nowhere", "-o", "f.npz"],
    "reconstruct": ["nowhere"],
    "view": ["nowhere"],
    "export": ["nowhere"],
    "grasp": ["nowhere"],
    "config show": ["--preset", "nonsense"],
    "fetch": ["nonsense"],
    "eval": ["nowhere"],
    "demo": ["-o", "/proc/nowhere/x"],
}


def fails(arguments: list[str], cwd) -> tuple[set[str], float]:
    """What a fresh interpreter has imported when the command has failed, and its user time."""
    code = (
        "import json, sys\n"
        "from brrp_cli.cli import main\n"
        "try:\n"
        f"    main({arguments!r})\n"
        "except SystemExit as end:\n"
        "    assert end.code in (1, 2), end.code\n"
        "print('MODULES' + json.dumps(sorted(sys.modules)))"
    )
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=cwd
    )
    assert "Error: " in done.stderr and "Traceback" not in done.stderr
    spent = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    return set(json.loads(done.stdout.rpartition("MODULES")[2])), spent


@pytest.mark.parametrize("name", WRONG)
def test_an_error_that_needs_nothing_heavy_is_soon_told(name, tmp_path):
    modules, spent = fails([*name.split(), *WRONG[name]], tmp_path)
    assert not modules & HEAVY
    # A core that others use too runs at half its speed, at times: the best of some counts.
    times = [spent]
    while min(times) > SECONDS and len(times) < 4:
        times.append(fails([*name.split(), *WRONG[name]], tmp_path)[1])
    assert min(times) <= 2 * SECONDS, times


def test_every_command_is_tried_with_something_wrong():
    assert {name.split()[0] for name in WRONG} == set(COMMANDS)
