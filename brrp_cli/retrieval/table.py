"""Retrieval from a file: probabilities that the user brings along.

JSON: {"1": {"mug": 0.8, "bowl": 0.1}, "2": {}}, object id -> name in the prior -> probability. CSV:
the columns object, name and probability, one row for each pair. Names that are not mentioned have
probability 0; what is missing from 1 is the probability that the prior does not hold the object.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import RetrievalError
from brrp_cli.files import parse_json, read_text, trouble_of
from brrp_cli.frames.frame import Frame

EXPECTED = 'JSON {"1": {"NAME": 0.9}, "2": {}}, or CSV with the columns object, name, probability'
_COLUMNS = ("object", "name", "probability")
# Numbers that were rounded for a file may sum to a little more than 1.
ROUNDING = 1e-3


class TableRetriever:
    """P(c|R) as the file says. names : the prior's. Errors: RetrievalError for a file that cannot
    be used, names that the prior does not hold, and numbers that are no probabilities."""

    name = "table"

    def __init__(self, path: Path, names: Sequence[str]) -> None:
        self._path = path
        self._rows = {
            object_id: _row(path, object_id, given, list(names))
            for object_id, given in _read(path).items()
        }

    def probabilities(self, frame: Frame, object_id: int) -> NDArray[np.float64]:
        """P(c|R) (n,) for one object. Errors: RetrievalError if the file does not name it."""
        if object_id not in self._rows:
            raise RetrievalError(
                "The table of probabilities does not name an object of the frame",
                where=self._path,
                expected=f"object {object_id}",
                found="objects " + (", ".join(map(str, self._rows)) or "none"),
                fix=f'add "{object_id}": {{}} if the prior does not hold it',
            )
        return self._rows[object_id]


def _read(path: Path) -> dict[int, dict[str, Any]]:
    try:
        text = read_text(path)
        return _rows_of(_from_csv(text) if path.suffix.lower() == ".csv" else parse_json(text))
    except (OSError, ValueError, csv.Error) as error:
        raise RetrievalError(
            "The table of probabilities cannot be read",
            where=path,
            expected=EXPECTED,
            found=trouble_of(error),
            fix="write the file in one of these forms",
        ) from error


def _rows_of(table: Any) -> dict[int, dict[str, Any]]:
    """Id -> name -> probability of what the file holds. Errors: ValueError, in words."""
    if not isinstance(table, dict):
        raise ValueError("no JSON object of ids: it begins with no {")
    rows = {}
    for object_id, given in table.items():
        try:
            number = int(object_id)
        except ValueError:
            raise ValueError(f"{object_id!r} in place of an object's id, a whole number") from None
        if not isinstance(given, dict):
            raise ValueError(f'object {number}: {given!r} in place of {{"NAME": probability}}')
        rows[number] = given
    return rows


def _from_csv(text: str) -> dict[str, dict[str, float]]:
    """Errors: ValueError, in words; csv.Error."""
    rows = csv.DictReader(text.splitlines())
    columns = rows.fieldnames or []
    lacking = [name for name in _COLUMNS if name not in columns]
    if lacking:
        raise ValueError(f"no column {lacking[0]}; the columns are {', '.join(columns) or 'none'}")
    table: dict[str, dict[str, float]] = {}
    for row in rows:
        given = table.setdefault(row["object"], {})
        if row["name"]:
            try:
                given[row["name"]] = float(row["probability"])
            except (TypeError, ValueError):
                raise ValueError(
                    f"line {rows.line_num}: {row['probability'] or 'nothing'} in place of a"
                    " probability"
                ) from None
    return table


def _row(
    path: Path, object_id: int, given: dict[str, Any], names: list[str]
) -> NDArray[np.float64]:
    where = f"{path}, object {object_id}"
    strangers = [name for name in given if name not in names]
    if strangers:
        raise RetrievalError(
            "The table names objects that the prior does not hold",
            where=where,
            expected="names as brrp info lists them",
            found=", ".join(strangers[:5]),
        )
    bad = [v for v in given.values() if not isinstance(v, int | float) or not 0 <= v < math.inf]
    total = 0.0 if bad else float(sum(given.values()))
    if bad or total > 1 + ROUNDING:
        raise RetrievalError(
            "The table holds numbers that are no probabilities",
            where=where,
            expected="from 0 to 1, with a sum of at most 1",
            found=bad[0] if bad else f"a sum of {total:g}",
        )
    row = np.zeros(len(names))
    for name, value in given.items():
        row[names.index(name)] = value / max(total, 1.0)
    return row
