"""Configurations, which are frozen dataclasses of one another, and the tables of a TOML file."""

from __future__ import annotations

import json
import math
import types
from collections.abc import Mapping
from dataclasses import MISSING, Field, asdict, fields, is_dataclass, replace
from typing import Any, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

from brrp_cli.config.ranges import LEAST, MOST
from brrp_cli.errors import ConfigError
from brrp_cli.similar_names import most_similar_name

T = TypeVar("T")


def changed(config: T, table: Mapping[str, Any], source: object, inside: str = "") -> T:
    """`config` with the values of `table`, which has the same structure and may be a part of it.

    source : the file, for messages; inside : where in it the table stands, "" or "a.b."
    Errors: ConfigError for a key that is not there, a value of another type or out of range.
    """
    kinds = get_type_hints(type(config))
    known = {each.name: each for each in fields(config) if each.init}  # type: ignore[arg-type]
    values = {}
    for key, value in table.items():
        if key not in known:
            raise unknown_key(source, inside + key, inside, known)
        kind, current = kinds[key], getattr(config, key)
        place = _Place(f"{source}: {inside}{key}", _advice(inside + key, current))
        nested = _dataclass_of(kind)
        if nested is None:
            values[key] = _value(value, kind, known[key], place)
        elif isinstance(value, Mapping):
            start = nested() if current is None else current
            values[key] = changed(start, value, source, f"{inside}{key}.")
        else:
            advice = f"write its keys below a line [{inside}{key}]"
            raise _refused(place._replace(advice=advice), f"a table [{inside}{key}]", value)
    return replace(config, **values)  # type: ignore[type-var]


class _Place(NamedTuple):
    """Where a value stands: file and key; and what to do if it cannot be used."""

    where: str
    advice: str


def _advice(key: str, current: Any) -> str:
    """What to do about a value that cannot be used, and what stands for it if it is left out."""
    text = f"give {key} such a value, or leave it out"
    if current is None or is_dataclass(current):
        return text
    kept = list(current) if isinstance(current, tuple) else current
    return f"{text}: it is {json.dumps(kept)} then"  # as TOML writes it


def unknown_key(
    source: object, key: str, inside: str, known: Mapping[str, Any], of_other: str | None = None
) -> ConfigError:
    """The message for a key that is not there, with the one that was meant, or else what is told of
    one `of_other` configurations."""
    meant = most_similar_name(key.removeprefix(inside), known)
    return ConfigError(
        "The configuration has no such key",
        where=f"{source}: {key}",
        expected=", ".join(inside + name for name in known),
        found=key,
        fix=f"did you mean {inside + meant}?"
        if meant
        else of_other or "brrp config show prints every key",
    )


def plain(config: Any) -> dict[str, Any]:
    """Tables of a configuration for TOML, which has no word for what is None."""
    return {key: _plain(value) for key, value in asdict(config).items() if value is not None}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items() if each is not None}
    return list(value) if isinstance(value, tuple) else value


def _dataclass_of(kind: Any) -> Any:
    """The dataclass that a field of that type holds, also where it may be None; else None."""
    options = get_args(kind) if get_origin(kind) in (Union, types.UnionType) else (kind,)
    return next((each for each in options if is_dataclass(each)), None)


def _value(value: Any, kind: Any, field: Field[Any], place: _Place) -> Any:
    if get_origin(kind) is not tuple:
        return _scalar(value, kind, field, place)
    inner = get_args(kind)
    count = None if inner[-1] is Ellipsis else len(inner)
    # Tuples are of a record that was never written.
    if not isinstance(value, (list, tuple)) or not value or count not in (None, len(value)):
        raise _refused(place, f"a list of {count or 'one or more'} numbers", value)
    return tuple(_scalar(each, inner[0], field, place) for each in value)


def _scalar(value: Any, kind: Any, field: Field[Any], place: _Place) -> Any:
    """The value, of the field's type and in its range."""
    if kind in (bool, str):
        if not isinstance(value, kind):
            raise _refused(place, "true or false" if kind is bool else "a text", value)
        return value
    whole = kind is int
    good = isinstance(value, int) if whole else isinstance(value, (int, float))
    what = "a whole number" if whole else "a number"
    if not good or isinstance(value, bool) or not math.isfinite(value):
        raise _refused(place, what, value)
    least, most, least_is_allowed = _range(field)
    low = value < least if least_is_allowed else value <= least
    if low or value > most:
        limits = [f"{'at least' if least_is_allowed else 'above'} {least:g}"] * (least > -math.inf)
        limits += [f"at most {most:g}"] * (most < math.inf)
        raise _refused(place, f"{what}, {' and '.join(limits)}", value)
    return value if whole else float(value)


def _range(field: Field[Any]) -> tuple[float, float, bool]:
    """Least, most, and whether the least itself is allowed; see `ranges`."""
    if LEAST in field.metadata:
        return field.metadata[LEAST], field.metadata[MOST], True
    made = field.default_factory
    default = field.default if made is MISSING else made()
    lowest = min(default) if isinstance(default, tuple) else default
    if not isinstance(lowest, (int, float)) or lowest < 0:
        return -math.inf, math.inf, True
    return 0.0, math.inf, lowest == 0


def _refused(place: _Place, expected: str, found: object) -> ConfigError:
    return ConfigError(
        "The configuration has a value that cannot be used",
        where=place.where,
        expected=expected,
        found=f"{found!r:.80}",
        fix=place.advice,
    )
