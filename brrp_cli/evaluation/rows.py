"""Rows of results: one for each object and variant, kept as they come, written as a table.

`rows.jsonl` is appended to while a run goes on, by any of its workers; a run that was killed may
leave a line without its end. `metrics.csv` is made from it when the run ends.
"""

from __future__ import annotations

import csv
import io
import json
import math
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, BinaryIO

from filelock import FileLock

from brrp_cli.evaluation.pose_error import POSE
from brrp_cli.evaluation.recognition import RECOGNITION
from brrp_cli.evaluation.score_object import PROBABILITY_METRICS, REGIONS, SHAPE_METRICS
from brrp_cli.evaluation.variants import Variant
from brrp_cli.files import cannot_write, parse_json, write_bytes
from brrp_cli.ground_truth.surface_metrics import SURFACE_METRICS

Row = dict[str, Any]

VARIANT = ("method", "preset", "k", "retriever", "weights", "shift")
OBJECT = ("scene", "view", "object_id", "name", "visible_pixels", "objects_in_view")
METRICS = (
    *SURFACE_METRICS,
    *SHAPE_METRICS,
    *(f"{metric}_{region}" for region in REGIONS for metric in PROBABILITY_METRICS),
)
RESULT = (
    "status",
    "message",
    "points",
    "thickness",
    "thickness_class",
    *METRICS,
    "in_prior",
    "not_in_prior",
    "true_rank",
    "true_probability",
    "best",
    "best_probability",
    "placed",
    "placement_error",
    *RECOGNITION,
    *POSE,
)
STAGES = ("observation", "retrieval", "registration", "inference", "surface")
COST = (*(f"seconds_{stage}" for stage in STAGES), "seconds_total", "peak_memory_mb")
COLUMNS = (*OBJECT, *VARIANT, *RESULT, *COST)
_NEEDED = ("scene", "object_id", "objects_in_view")


class RowLog:
    """The file that rows are appended to."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def append(self, rows: Iterable[Row]) -> None:
        """Add rows, together, from any process. Errors: OutputError."""
        text = "".join(json.dumps(_plain(row)) + "\n" for row in rows)
        try:
            with FileLock(self.path.with_name(".rows.lock")), self.path.open("a+b") as stream:
                # A full disk, or a kill, may have left a line without its end: `read` did not count
                # it, so that its row is here again.
                _drop_unfinished(stream)
                stream.write(text.encode())
                stream.flush()
                os.fsync(stream.fileno())
        except OSError as error:
            raise cannot_write(self.path, error) from error

    def read(self) -> list[Row]:
        """The rows that are whole."""
        if not self.path.exists():
            return []
        lines = self.path.read_bytes().split(b"\n")
        # What follows the last newline was never finished.
        rows = [_row(line) for line in lines[:-1]]
        return [_restored(row) for row in rows if row is not None]

    def replace(self, rows: Iterable[Row]) -> None:
        """Keep these rows alone."""
        write_bytes(self.path, "".join(json.dumps(_plain(r)) + "\n" for r in rows).encode())


def _drop_unfinished(stream: BinaryIO) -> None:
    """Cut what follows the last newline."""
    stream.seek(0)
    stream.truncate(stream.read().rfind(b"\n") + 1)


def _row(line: bytes) -> Row | None:
    """None for a line that was cut."""
    try:
        row = parse_json(line)
    except ValueError:
        return None
    whole = isinstance(row, dict) and row.keys() >= {*VARIANT, *_NEEDED}
    return row if whole else None


def variant_of(row: Mapping[str, Any]) -> Variant:
    """The variant that a row belongs to."""
    return Variant(**{name: row[name] for name in VARIANT})


def variant_columns(variant: Variant) -> Row:
    """The columns that say which variant it is."""
    return {name: getattr(variant, name) for name in VARIANT}


def finished(rows: Iterable[Row]) -> tuple[list[Row], set[tuple[str, Variant]]]:
    """The rows of views that are complete, and which those are: (scene, variant)."""
    groups: dict[tuple[str, Variant], dict[Any, Row]] = {}
    for row in rows:
        groups.setdefault((row["scene"], variant_of(row)), {})[row["object_id"]] = row
    whole = {
        unit: list(found.values())
        for unit, found in groups.items()
        if all(row["objects_in_view"] == len(found) for row in found.values())
    }
    return [row for found in whole.values() for row in found], set(whole)


def table(rows: Iterable[Row]) -> str:
    """CSV with `COLUMNS`. Empty: no value. Lengths in metres."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, COLUMNS, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({k: _cell(v) for k, v in row.items()})
    return stream.getvalue()


def _cell(value: Any) -> Any:
    return "" if value is None or (isinstance(value, float) and math.isnan(value)) else value


def _plain(row: Row) -> Row:
    """JSON has no NaN."""
    return {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in row.items()}


def _restored(row: Row) -> Row:
    """A metric without a value is NaN again."""
    return {k: math.nan if v is None and k in METRICS else v for k, v in row.items()}
