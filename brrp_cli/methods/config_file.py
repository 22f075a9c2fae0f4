"""A method's configuration in a TOML file: what differs from one of its presets.

    preset = "default"          # the preset that the file changes; its keys and tables follow
    k = 5

    [surface]
    spacing = 0.004

    [segmentation]              # only where masks are made
    min_height = 0.006

`method` may stand beside `preset`, so that the file is not used for another one by mistake. `brrp
config show` prints all keys with their values.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.config.tables import changed, plain, unknown_key
from brrp_cli.errors import BrrpError, ConfigError
from brrp_cli.methods.base import Method
from brrp_cli.methods.registry import DEFAULT, METHODS
from brrp_cli.similar_names import most_similar_name
from brrp_cli.spoken import option

METHOD, PRESET, SEGMENTATION = "method", "preset", "segmentation"


@dataclass(frozen=True)
class ConfigFile:
    """A file as it was read once. Errors are told when its values are taken."""

    path: Path
    table: Mapping[str, Any]

    @property
    def method(self) -> str:
        """The method that the file is of. Errors: ConfigError."""
        name = self.table.get(METHOD, DEFAULT)
        if name not in METHODS:
            raise ConfigError(
                "No such method",
                where=f"{self.path}: {METHOD}",
                expected=", ".join(METHODS),
                found=name,
                fix=_meant(name, METHODS),
            )
        return str(name)

    def preset(self, method: Method) -> str:
        """The preset that the file changes."""
        return str(self.table.get(PRESET, next(iter(method.presets))))

    def config(self, method: Method, preset: str | None = None) -> Any:
        """The method's configuration: a preset, else the file's, else the method's first, with
        the file's changes. Errors: ConfigError."""
        if METHOD in self.table and self.method != method.name:
            raise ConfigError(
                "The configuration is of another method",
                where=f"{self.path}: {METHOD}",
                expected=method.name,
                found=self.method,
                fix=f"choose its method with {option('method', self.method)}, or give another file",
            )
        try:
            start = method.preset(preset or self.table.get(PRESET))
        except (BrrpError, TypeError) as error:
            raise ConfigError(
                f"{method.name} has no such preset",
                where=f"{self.path}: {PRESET}",
                expected=", ".join(method.presets),
                found=self.table.get(PRESET),
                fix=_meant(self.table.get(PRESET), method.presets),
            ) from error
        known = {each.name: None for each in fields(start)}
        own = {k: v for k, v in self.table.items() if k not in (METHOD, PRESET, SEGMENTATION)}
        for key in own:
            if key not in known:
                every = {METHOD: None, PRESET: None, **known, SEGMENTATION: None}
                raise unknown_key(self.path, key, "", every, _of_other(key))
        self.segmentation()
        return changed(start, own, self.path)

    def segmentation(self) -> SegmentConfig:
        """What makes masks. Errors: ConfigError."""
        table = {SEGMENTATION: self.table.get(SEGMENTATION, {})}
        return changed(_Masks(), table, self.path).segmentation


@dataclass(frozen=True)
class _Masks:
    segmentation: SegmentConfig = field(default_factory=SegmentConfig)


def _meant(name: object, known: Iterable[str]) -> str:
    """Advice for a name that is none of those that are known."""
    meant = most_similar_name(str(name), known)
    return f"did you mean {meant}?" if meant else "write one of these names"


def _of_other(key: str) -> str | None:
    """Advice for a key that only other methods know; None for one that none knows."""
    for name, method in METHODS.items():
        if any(key in {each.name for each in fields(one)} for one in method.presets.values()):
            return f"it is a key of another method: {option('method', name)}"
    return None


def read_config(path: str | Path) -> ConfigFile:
    """Read a file. Errors: ConfigError if it is missing or no TOML."""
    path = Path(path)
    try:
        return ConfigFile(path, tomllib.loads(path.read_text(encoding="utf-8")))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(
            "The configuration cannot be read",
            where=path,
            expected="a TOML file, such as brrp config show prints",
            found=error.strerror if isinstance(error, OSError) else error,
            fix="check the path"
            if isinstance(error, OSError)
            else "mend that place; texts stand in quotes, as brrp config show prints them",
        ) from error


def load_config(path: str | Path, preset: str | None = None, method: str = DEFAULT) -> Any:
    """The configuration of a method, changed by a file; `config=` of `reconstruct` takes it.

    preset : the one to start from; without it the file's, else the method's first
    Errors: ConfigError with file and key, what was expected and what was found.
    """
    return read_config(path).config(METHODS[method], preset)


def as_toml(method: Method, config: Any, segmentation: SegmentConfig) -> str:
    """Every number that decides a result of the method, as a file that `load_config` reads."""
    import tomli_w

    table = plain(config)
    preset = table.pop(PRESET, next(iter(method.presets)))
    return tomli_w.dumps(
        {METHOD: method.name, PRESET: preset, **table, SEGMENTATION: plain(segmentation)}
    )
