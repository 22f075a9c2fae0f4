"""Time `brrp build-prior`: each mesh stage by stage, and the whole with more and more meshes.

    python tools/benchmark_build.py ycb/
    python tools/benchmark_build.py ycb/ --stages 20 --counts 10,20,40 --json build.jsonl

Stages are those of one mesh after the other, in one process with one thread. Then whole builds of
the first so many meshes, each a command of its own with one worker and with all cores: seconds on
the wall and of CPU a mesh, and the memory of the greatest process, which must not grow.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import click

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message
from speed.measure import cold, run, spread

from brrp_cli.prior.build.find_meshes import MeshSource, find_meshes
from brrp_cli.prior.build.make_object import make_object
from brrp_cli.prior.parameters import BuildParameters
from brrp_cli.threads import cores, in_threads


@click.command()
@click.argument("meshes", type=click.Path(path_type=Path))
@click.option("--stages", default=16, show_default=True, type=click.IntRange(1), help="Meshes.")
@click.option("--counts", default="4,8,16", show_default=True, help="Meshes of the whole builds.")
@click.option("--json", "history", type=click.Path(path_type=Path), help="Append a line here.")
@one_message()
def main(meshes: Path, stages: int, counts: str, history: Path | None) -> None:
    """Time building a prior of the folder MESHES."""
    sources = list(find_meshes(meshes))
    record: dict[str, Any] = {"stages": time_stages(_spaced(sources, stages))}
    entries = [meshes.absolute() / Path(source.relative).parts[0] for source in sources]
    record["builds"] = time_builds(entries, [int(count) for count in counts.split(",")])
    if history is not None:
        with history.open("a") as stream:
            stream.write(json.dumps(record) + "\n")


def time_stages(sources: list[MeshSource]) -> dict[str, dict[str, float]]:
    """Seconds of each stage of a mesh; prints them."""

    def make(source: MeshSource) -> dict[str, float]:
        seconds: dict[str, float] = {}
        seconds["whole"] = run(lambda: make_object(source, BuildParameters(), seconds)).wall
        return seconds

    # The first mesh pays for the imports.
    make(sources[0])
    made = list(in_threads(make, sources, 1))
    click.echo(
        f"{len(made)} meshes, seconds of one core\n{'':12}{'median':>9}{'least':>9}{'most':>9}"
    )
    found = {}
    for stage in made[0]:
        each = spread([seconds[stage] for seconds in made])
        click.echo(f"{stage:12}{each.median:9.3f}{each.least:9.3f}{each.most:9.3f}")
        found[stage] = each.as_dict()
    return found


def time_builds(entries: list[Path], counts: list[int]) -> list[dict[str, float]]:
    """Whole builds of the first so many files or folders of meshes; prints and returns what each
    took."""
    click.echo(f"{'meshes':>8}{'workers':>9}{'s':>8}{'s a mesh':>10}{'CPU s a mesh':>14}{'MB':>7}")
    found = []
    for count in (min(count, len(entries)) for count in counts):
        for workers in sorted({1, cores()}):
            with tempfile.TemporaryDirectory() as folder:
                first = Path(folder) / "meshes"
                first.mkdir()
                for entry in entries[:count]:
                    (first / entry.name).symlink_to(entry)
                out = Path(folder) / "prior"
                spent = cold("build-prior", first, "-o", out, "--workers", str(workers))
            click.echo(
                f"{count:8}{workers:9}{spent.wall:8.1f}{spent.wall / count:10.2f}"
                f"{spent.cpu / count:14.2f}{spent.megabytes:7.0f}"
            )
            found.append({"meshes": count, "workers": workers, **vars(spent)})
    return found


def _spaced(sources: list[MeshSource], count: int) -> list[MeshSource]:
    """So many of them, evenly over the folder."""
    step = max(1, len(sources) // count)
    return sources[::step][:count]


if __name__ == "__main__":
    main()
