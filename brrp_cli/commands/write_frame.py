"""What `brrp reconstruct` does with each frame: reconstruct it, write it all, and tell of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from brrp_cli.commands.made_masks import MadeMasks, forget_picture, masks_asked
from brrp_cli.commands.object_table import Told, lines, told
from brrp_cli.spoken import counted

if TYPE_CHECKING:
    from brrp_cli.commands.beside import Beside
    from brrp_cli.commands.do_frame import DoFrame
    from brrp_cli.commands.source_options import SourceOptions
    from brrp_cli.frames.frame import Frame
    from brrp_cli.reconstruction import Reconstruction


@dataclass(frozen=True)
class WriteFrame:
    """coordinates : "camera" or "world", of the meshes; replaces : whether results that are there
    make way; beside : what is written beside the results"""

    do: DoFrame
    source: SourceOptions
    coordinates: str
    replaces: bool
    beside: Beside

    def __call__(
        self, read: Frame, frame: Frame, masks: MadeMasks | None, output: Path, again: bool
    ) -> list[Told]:
        """What is told of the objects of a frame, once all is written.

        read : the frame as it was read; frame, masks : with masks, and how they were made; again :
        whether its own results that are there make way, too
        """
        from brrp_cli.api import open_result
        from brrp_cli.results.write import write_results

        result = self.do(frame, masks, output)
        replaced = output.exists()
        made = self.source.prompt is not None or not read.object_ids
        write_results(
            result,
            output,
            frame=self.coordinates,
            overwrite=self.replaces or again,
            read=read,
            masks=masks_asked(self.source) if made else None,
        )
        if replaced:
            forget_picture(read, result, self.source, output)
        table = told(result)
        for line in [*lines(table), self._written(result, output)]:
            click.echo(line)
        self.beside.write(open_result(output))
        return table

    def _written(self, result: Reconstruction, output: Path) -> str:
        done = len(result.reconstructed)
        meshes = "object_*.ply, scene.glb, " if done else "no mesh: result.json says why; "
        return (
            f"Wrote {done} of {counted(len(result.objects), 'object')}, metres,"
            f" {self.coordinates} frame: {output}/ ({meshes}posterior.h5, result.json, preview.png)"
        )
