"""Short phrases that tell CLIP what an object looks like ("a red cracker box")."""

from __future__ import annotations

import csv
import logging
import re
import tomllib
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

from brrp_cli.errors import PriorError
from brrp_cli.files import parse_json, read_text, trouble_of
from brrp_cli.similar_names import most_similar_name
from brrp_cli.spoken import few

log = logging.getLogger(__name__)

YCB_MANIFEST = Path(__file__).parents[2] / "data_manifests" / "ycb.toml"


def phrase_from_name(name: str) -> str:
    """A phrase from a file's name: `big_red_cup` gives "a big red cup"."""
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    text = re.sub(r"[_\-.\s]+", " ", text).strip().lower()
    # Catalogue numbers before a word ("035 power drill") say nothing about looks.
    text = re.sub(r"^(\d+ )+(?=[a-z])", "", text)
    if not re.search("[a-z]", text):
        return "an object"
    article = "an" if text[0] in "aeiou" else "a"
    return f"{article} {text}"


def read_descriptions(path: Path) -> dict[str, str]:
    """Name -> phrase from a TOML, JSON or CSV file.

    TOML and JSON: one table of phrases, alone or under the key `descriptions`; CSV: two columns,
    name and phrase, without a heading. Errors: PriorError.
    """
    try:
        text = read_text(path)
        table: Any
        if path.suffix.lower() == ".toml":
            table = tomllib.loads(text)
        elif path.suffix.lower() == ".json":
            table = parse_json(text)
        elif path.suffix.lower() == ".csv":
            table = _read_csv(text)
        else:
            raise PriorError(
                "Descriptions in an unknown format", where=path, expected=".toml, .json or .csv"
            )
    except (OSError, ValueError, csv.Error) as error:
        raise PriorError(
            "Cannot read the descriptions",
            where=path,
            expected='TOML: cup = "a red cup"; JSON: {"cup": "a red cup"}; CSV: cup,a red cup',
            found=trouble_of(error),
            fix="check the path" if isinstance(error, OSError) else "write the file in such a form",
        ) from error
    if isinstance(table, dict) and isinstance(table.get("descriptions"), dict):
        table = table["descriptions"]
    if not isinstance(table, dict):
        raise PriorError(
            "The descriptions are no table",
            where=path,
            expected="name -> phrase",
            found="a list" if isinstance(table, list) else repr(table),
            fix='write a table: {"cup": "a red cup"}',
        )
    for name, phrase in table.items():
        if not isinstance(phrase, str) or not phrase.strip():
            raise PriorError(
                "A description is no phrase",
                where=f"{path}, {name}",
                expected='words such as "a red cracker box"',
                found=repr(phrase),
            )
    return {name: phrase.strip() for name, phrase in table.items()}


def _read_csv(text: str) -> dict[str, str]:
    table = {}
    for number, row in enumerate(csv.reader(text.splitlines()), start=1):
        if not row:
            continue
        if len(row) != 2:
            raise ValueError(f"row {number} has {len(row)} columns, expected: name,phrase")
        table[row[0].strip()] = row[1]
    return table


def phrases_of(names: Collection[str], descriptions: Path | None) -> dict[str, str]:
    """A phrase for each name of a mesh, first of all from the file; names in it that no mesh has
    are noted. Errors: PriorError."""
    given = read_descriptions(descriptions) if descriptions else {}
    strangers = [name for name in given if name not in names]
    if strangers:
        meant = most_similar_name(strangers[0], names)
        log.info(
            "%s describes what is none of the meshes: %s%s",
            descriptions,
            few(strangers),
            f" (is {strangers[0]} {meant}?)" if meant else "",
        )
    return describe(names, given)


def describe(names: Iterable[str], given: dict[str, str]) -> dict[str, str]:
    """A phrase for each name: from `given`, else from the YCB manifest, else from the name."""
    known = {**read_descriptions(YCB_MANIFEST), **given}
    return {name: known.get(name) or phrase_from_name(name) for name in names}
