"""What `brrp reconstruct` writes beside the results where it is asked to."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brrp_cli.commands.export import FOLDER as PLAN_FOLDER
from brrp_cli.commands.export import export
from brrp_cli.commands.grasp import JSON, grasp
from brrp_cli.commands.view import PAGE, title, view
from brrp_cli.files import atomic_path, parse_json
from brrp_cli.grasping.record import RECORD as GRASPS
from brrp_cli.planning.options import PlanOptions
from brrp_cli.progress import note
from brrp_cli.spoken import counted

if TYPE_CHECKING:
    from brrp_cli.grasping.gripper import Gripper
    from brrp_cli.results.read import StoredResult

POSES = "poses_bop.csv"
PLAN = f"{PLAN_FOLDER}/plan.json"


@dataclass(frozen=True)
class Beside:
    """What is asked for.

    poses : the BOP results file; names : of the prior's objects; plan : how collision shapes are
    made; hand : that is to grasp; page : the HTML page; open_it : in a browser
    """

    poses: bool
    names: Sequence[str]
    plan: PlanOptions | None
    hand: Gripper | None
    page: bool
    open_it: bool
    seed: int

    def lacking(self, stored: StoredResult) -> list[str]:
        """What of it is not there, or was made in another way; none of what needs a mesh where no
        object has one. In the order in which it is written: the page shows what the others are."""
        meshes = any(item["mesh"] is not None for item in stored.record["objects"])
        lacks = {
            POSES: self.poses and not (stored.folder / POSES).is_file(),
            PLAN: meshes and self.plan is not None and not _as_asked(stored, PLAN, _of(self.plan)),
            GRASPS: meshes
            and self.hand is not None
            and not _as_asked(stored, GRASPS, {"gripper": self.hand.name, "seed": self.seed}),
        }
        lacks[PAGE] = self.page and (
            lacks[PLAN] or lacks[GRASPS] or not (stored.folder / PAGE).is_file()
        )
        return [name for name, lack in lacks.items() if lack]

    def write(self, stored: StoredResult, which: Collection[str] | None = None) -> None:
        """Write it, or `which` of it, and say so. Errors: BrrpError."""
        asked = {POSES: self.poses, PLAN: self.plan, GRASPS: self.hand, PAGE: self.page}
        wanted = {n for n, ask in asked.items() if ask and (which is None or n in which)}
        if POSES in wanted:
            self._write_poses(stored)
        of_meshes = wanted & {PLAN, GRASPS}
        if of_meshes and not stored.surfaces:
            note(f"No object has a mesh: {' and '.join(sorted(of_meshes))} not written")
        elif of_meshes:
            if PLAN in wanted and self.plan is not None:
                export(stored, None, self.plan, overwrite=which is not None)
            if GRASPS in wanted and self.hand is not None:
                grasp(stored, self.hand, stored.folder / GRASPS, JSON, seed=self.seed)
        if PAGE in wanted:
            view(stored, title(stored.folder), stored.folder / PAGE, open_it=self.open_it)

    def _write_poses(self, stored: StoredResult) -> None:
        from brrp_cli.results.bop import bop_csv, bop_rows

        with atomic_path(stored.folder / POSES) as path:
            path.write_text(bop_csv(stored.record, self.names))
        poses = counted(len(bop_rows(stored.record, self.names)), "pose")
        click.echo(f"Wrote {poses} of recognised objects: {stored.folder / POSES}")


def _of(options: PlanOptions) -> dict[str, Any]:
    return {"collision": options.collision, "confidence": options.confidence, "seed": options.seed}


def _as_asked(stored: StoredResult, name: str, asked: dict[str, Any]) -> bool:
    """Whether a record beside the results is there and tells what was asked for."""
    path: Path = stored.folder / name
    if not path.is_file():
        return False
    try:
        record = parse_json(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    if not isinstance(record, dict):
        return False
    told = {key: record.get(key) for key in asked}
    if isinstance(gripper := told.get("gripper"), dict):
        told["gripper"] = gripper.get("name")
    return told == asked
